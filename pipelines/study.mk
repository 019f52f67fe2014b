# Repeats the experiments of the thesis (chapters 4 and 5) in one run: maps of four scenarios, from an
# earlier scan (pre-scanned) and from the robot's cameras (in situ); look-up of the field test's
# locations in every map; inclinations of the robot's body; thresholds; masks; virtual field test; one
# report. Needs no data: sites, scans and cameras are simulated. If GRASPMAP_DATA is the folder of the
# thesis author's data, the author's clouds are also processed and the published tables evaluated.
#
#   make -f pipelines/study.mk OUT=folder [SCENARIOS="1 2 3 4"] [METHODS="thesis corrected"] \
#        [STAGES="walls published thresholds masks grasp report"] [INCLINATIONS="10 25"] [SEED=1] -j2
#
# site.mk computes each map. The terrain of a pre-scanned map consists of COUNT Poisson-disk samples of the
# site's true mesh. The terrain in situ is a panorama of the robot's six depth images at one pose, with
# the noise of a real sensor (SENSOR). EDGE, SPACING and COUNT set the resolution of sites, scene and
# samples. CAMERAS, PANORAMA and LOOKUP are further flags of `simulate cameras`, `fuse` and `lookup`; on
# the wall, the look-up of a hold uses the best voxel within HOLD_RADIUS instead. SHARES is the number of
# threads per map. PLACES and TRIALS are the numbers of locations and trials of the virtual field
# test. A second run does nothing. If a variable or a file changes, the results that depend on it are
# recomputed.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
SCENARIOS ?= 1 2 3 4
METHODS ?= thesis corrected
STAGES ?= walls published thresholds masks grasp report
INCLINATIONS ?= 10 25
OBSTACLE_HEIGHT ?= 0.3
SEED ?= 1
EDGE ?= 0.008
SPACING ?= 0.0068
COUNT ?= 73000
SENSOR ?= --noise 0.001 --noise-of-range 0.004 --max-incidence 80 --flying-pixels 0.1 \
  --edge-dropouts 0.5
CAMERAS ?=
PANORAMA ?= --flying-pixel-jump 0.03
LOOKUP ?=
HOLD_RADIUS ?= 0.05
SHARES ?= 1
PLACES ?= 1000
TRIALS ?= --trials 16 --draws 8

# make splits names at spaces, so a name with a space is an error.
one_word = $(if $(word 2,$($(1))),$(error $(1) contains a space, which make cannot handle: $($(1))))
$(foreach name,OUT SEED EDGE SPACING COUNT SHARES GRASPMAP_DATA,$(call one_word,$(name)))
ifeq ($(OUT),)
  $(error OUT is not set; set the folder for the results, e.g. OUT=study)
endif
# Ends make if a variable contains an unknown word. Arguments: variable, known words.
known = $(foreach word,$($(1)),$(if $(filter $(word),$(2)),,\
  $(error $(1) contains '$(word)', which is not one of: $(2))))
$(call known,SCENARIOS,1 2 3 4)
$(call known,METHODS,thesis envelope climblab corrected calibrated)
$(call known,STAGES,walls published thresholds masks grasp report)

include $(here)one_run.mk
ifdef is_alone

name_1 := primitive_shapes
name_2 := slopes_and_bumps
name_3 := bouldering_wall
name_4 := artificial_rocks
$(foreach n,1 2 3 4,$(eval folder_$(n) := $(OUT)/$(n)_$(name_$(n))))
data := $(firstword $(wildcard $(here)../data) $(here)..)
clouds := $(and $(GRASPMAP_DATA),$(wildcard $(GRASPMAP_DATA)/clouds))
tables := $(and $(GRASPMAP_DATA),$(wildcard $(GRASPMAP_DATA)/thesis))

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all FORCE
all:

# Text quoted as one word of the shell.
quoted = '$(subst ','\'',$(1))'

# Stamp file of variables, rewritten only if they change. Arguments: file, text.
define stamp
$(1): FORCE
	@mkdir -p $$(@D)
	@printf '%s\n' $(call quoted,$(strip $(2))) | cmp -s - $$@ || \
	  printf '%s\n' $(call quoted,$(strip $(2))) > $$@
endef

results :=
include $(here)study/scenarios.mk
include $(here)study/places.mk
include $(here)study/poses.mk
include $(here)study/walls.mk
include $(here)study/grasp.mk
include $(here)study/stages.mk

all: $(results)
endif
