# Threshold study of the thesis (table 5-6): one map for each pair of a solid-voxel threshold TSV and a
# number of extra void layers H_add, one image of all maps, and one table. On scenario 1 also the
# metrics that chapter 5.2.4 of the thesis requests: sensitivity and specificity against locations of
# expected graspability, and Youden's index over the two thresholds.
#
#   make -f pipelines/thresholds.mk OUT=folder [TSV="120 300 700 2500"] [HADD="1 3 5"] \
#        [METHODS="thesis corrected"] [SITE=cloud.pcd [EXPECTED=regions.csv]] [SCENARIO=...] -j2
#
# The thesis does not state its twelve pairs, so this grid is a choice of this project. The values of
# H_add are those of the published parameter sets (table B 2-1 and the gripper HubRobo: 1, 3, 5). A TSV
# reduces the score of a voxel if fewer ground voxels (SSV) are inside the mask. 120 is the thesis's TSV.
# 300 and 700 are about the 5th percentile and the median of SSV on scenario 1 with method `thesis`, 2500
# the median with `corrected`. SITE is another cloud, evaluated only if EXPECTED is set. A second run does
# nothing. If a variable or a file changes, the results that depend on it are recomputed.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
TSV ?= 120 300 700 2500
HADD ?= 1 3 5
METHODS ?= thesis corrected
SCENARIO ?= primitive_shapes_prescan
SPACING ?= 0.0068
SITE ?=
SCORE ?=
CELL ?= 360
export TITLE ?= $(if $(SITE),$(basename $(notdir $(SITE))),primitive shapes)
data := $(firstword $(wildcard $(here)../data) $(here)..)
EXPECTED ?= $(if $(SITE),,$(data)/expected/primitive_shapes.csv)

# make splits names at spaces, so a name with a space is an error.
one_word = $(if $(word 2,$($(1))),$(error $(1) contains a space, which make cannot handle: $($(1))))
$(foreach name,SITE OUT SCENARIO EXPECTED,$(call one_word,$(name)))
ifeq ($(OUT),)
  $(error OUT is not set; set the folder for the results, e.g. OUT=thresholds)
endif
$(foreach name,TSV HADD METHODS,$(if $(strip $($(name))),,$(error $(name) is empty)))

include $(here)one_run.mk
ifdef is_alone

terrain := $(or $(SITE),$(OUT)/terrain.pcd)
scenario_file := $(firstword $(wildcard $(SCENARIO) $(data)/scenarios/$(SCENARIO).yaml))
pairs := $(foreach h,$(HADD),$(foreach t,$(TSV),$(t)_$(h)))
maps_of = $(foreach pair,$(pairs),$(OUT)/$(1)/$(pair).pcd)
maps := $(foreach method,$(METHODS),$(call maps_of,$(method)))
tsv_of = $(firstword $(subst _, ,$(1)))
hadd_of = $(lastword $(subst _, ,$(1)))
# "TSV 120, H_add 1|TSV 300, H_add 1|...".
empty :=
space := $(empty) $(empty)
captions := $(subst $(space),|,$(foreach pair,$(pairs),TSV~$(call tsv_of,$(pair)),~H_add~$(call \
  hadd_of,$(pair))))
captions := $(subst ~, ,$(captions))

charts := $(foreach kind,graspable_share $(if $(EXPECTED),voxel_youden place_youden),\
  $(OUT)/$(kind).png $(OUT)/$(kind).svg)
results := $(foreach method,$(METHODS),$(OUT)/$(method).png) $(OUT)/thresholds.csv $(charts)

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all FORCE
all: $(results)

$(OUT) $(foreach method,$(METHODS),$(OUT)/$(method)):
	@mkdir -p $@

# Stamp files of the variables that results depend on, rewritten only if the variables change.
export scored_with := $(SITE) $(SCENARIO) $(SCORE) $(if $(SITE),,$(SPACING))
export shown_with := $(TSV); $(HADD); $(METHODS); $(EXPECTED) $(TITLE) $(CELL)
$(OUT)/scored_with $(OUT)/shown_with: FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

$(OUT)/terrain.pcd: $(OUT)/scored_with | $(OUT)
	@exec $(GRASPMAP) simulate scene --spacing $(SPACING) -o $@ --quiet

# make runs the maps in parallel, so each process uses one thread.
define score
$(OUT)/$(1)/%.pcd: $(terrain) $(OUT)/scored_with $(scenario_file) | $(OUT)/$(1)
	@exec $(GRASPMAP) score $$< -o $$@ --config $(SCENARIO) --method $(1) $(SCORE) --threads 1 --quiet \
	  --solid-voxel-threshold $$(call tsv_of,$$*) --extra-void-layers $$(call hadd_of,$$*)

$(OUT)/$(1).png: $(call maps_of,$(1)) $(OUT)/shown_with $(EXPECTED)
	@exec $(GRASPMAP) render $$(filter %.pcd,$$^) -o $$@ --columns $(words $(TSV)) --quiet \
	  --cell-width $(CELL) --captions "$(captions)" --title "$$$$TITLE: $(1)" \
	  $(if $(EXPECTED),--points $(EXPECTED) --verdict graspable --label none)
endef
$(foreach method,$(METHODS),$(eval $(call score,$(method))))

$(OUT)/thresholds.csv: $(maps) $(OUT)/shown_with $(EXPECTED)
	@exec $(GRASPMAP) analyze $(maps) -o $(OUT)/summary --varied solid_voxel_threshold \
	  --series method,extra_void_layers $(if $(EXPECTED),--expected $(EXPECTED))
	@cp $(OUT)/summary/maps.csv $@.partial && mv $@.partial $@
$(charts): $(OUT)/thresholds.csv
	@ln -f $(OUT)/summary/$(@F) $@
endif
