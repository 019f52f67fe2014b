# The thesis's chapters 4 and 5 as one run: its four scenarios, pre-scanned and in situ, the places
# of the field tests looked up in every map, the robot's body inclined, thresholds, masks, the
# published tables evaluated, and one report of all of it. Needs no data: sites, scans and the
# robot's cameras are simulated. Where GRASPMAP_DATA names the author's data, his clouds are run
# beside the simulated ones and his tables are evaluated.
#
#   make -f pipelines/study.mk OUT=folder [SCENARIOS="1 2 3 4"] [METHODS="thesis corrected"] \
#        [STAGES="walls published thresholds masks grasp report"] [INCLINATIONS="10 25"] [SEED=1] -j2
#
# A map is made by site.mk. Pre-scanned: Poisson-disk samples of the site's true mesh, COUNT of them.
# In situ: the six depth images of the robot at one pose on the site, with the noise of a real sensor
# (SENSOR), as one panorama. EDGE, SPACING and COUNT coarsen sites, scene and samples; CAMERAS and
# PANORAMA hold further flags of `simulate cameras` and `fuse`, LOOKUP of `lookup` (but of the
# wall a hold is looked up as the best within HOLD_RADIUS); SHARES is the number of processes that
# score one map; PLACES and TRIALS those of the virtual field test. A second run does nothing; other variables or changed files make again what depends
# on them.

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

# make splits names at spaces; better an error than half a name.
one_word = $(if $(word 2,$($(1))),$(error $(1) holds a space, which make cannot handle: $($(1))))
$(foreach name,OUT SEED EDGE SPACING COUNT SHARES GRASPMAP_DATA,$(call one_word,$(name)))
ifeq ($(OUT),)
  $(error OUT is not set: the folder of the results, e.g. OUT=study)
endif
# One of these words, or an error: variable, known words.
known = $(foreach word,$($(1)),$(if $(filter $(word),$(2)),,\
  $(error $(1) holds '$(word)', which is none of: $(2))))
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

# Text as one word of the shell.
quoted = '$(subst ','\'',$(1))'

# A stamp of variables that results depend on, written anew only if they change: file, text.
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
