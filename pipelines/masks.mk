# Comparison of the gripper masks: each method's mask in three sections, its map of each site, a chart of
# all scores, and the agreement of each pair of methods (Cohen's kappa).
#
#   make -f pipelines/masks.mk OUT=folder [SITES="name:cloud.pcd cloud.pcd ..."] \
#        [METHODS="thesis envelope climblab corrected"] [GRIPPERS="scar-e hubrobo"] -j2
#
# SITES are clouds, each with an optional name before a colon (default: the file's name). Without SITES,
# a scene of primitive shapes and a site of rocks are simulated; COUNT, EDGE and SPACING set their
# resolution. CELL is the width of an image in pixels. H_add is --extra-void-layers and TSV
# --solid-voxel-threshold of `graspmap score`. SCAR-E has the thesis's voxels of 10 mm, H_add 1 and TSV
# 120. HubRobo's published voxels of 1 mm are smaller than the point spacing of a site. Here, they are 5
# mm (a fifth of the palm's radius), which gives a mask of three layers. The published values are
# converted: H_add 3 to 1, and TSV 100 (of the mask's 7744 voxels) to 4 (of 324). For HubRobo, gaps
# between points are interpolated. The zero plane is so low that all ground counts. A second run does
# nothing. If a variable or a file changes, the results that depend on it are recomputed.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
SITES ?=
METHODS ?= thesis envelope climblab corrected
GRIPPERS ?= scar-e hubrobo
SCENARIO ?= artificial_rocks_prescan
SCORE ?=
COUNT ?= 73000
EDGE ?= 0.008
SPACING ?= 0.0068
CELL ?= 360
scar-e_mask ?= --voxel-size 0.01 --extra-void-layers 1
hubrobo_mask ?= --voxel-size 0.005 --extra-void-layers 1
scar-e_score ?= --solid-voxel-threshold 120
hubrobo_score ?= --solid-voxel-threshold 4 --curvature-radius 0.03 --set interpolation=yes

# make splits names at spaces, so a name with a space is an error.
one_word = $(if $(word 2,$($(1))),$(error $(1) contains a space, which make cannot handle: $($(1))))
$(foreach name,OUT SCENARIO,$(call one_word,$(name)))
ifeq ($(OUT),)
  $(error OUT is not set; set the folder for the results, e.g. OUT=masks)
endif
$(foreach name,METHODS GRIPPERS,$(if $(strip $($(name))),,$(error $(name) is empty)))

include $(here)one_run.mk
ifdef is_alone

simulated := primitive_shapes:$(OUT)/sites/primitive_shapes.pcd rocks:$(OUT)/sites/rocks.pcd
sites := $(or $(strip $(SITES)),$(simulated))
# Name and cloud of a site. Argument: an item of SITES.
name_of = $(if $(findstring :,$(1)),$(firstword $(subst :, ,$(1))),$(basename $(notdir $(1))))
cloud_of = $(lastword $(subst :, ,$(1)))
names := $(foreach site,$(sites),$(call name_of,$(site)))
ifneq ($(words $(names)),$(words $(sort $(names))))
  $(error SITES contains a duplicate name: $(names); use name:cloud.pcd to rename a site)
endif

maps_of = $(foreach method,$(METHODS),$(OUT)/$(1)/$(2)/$(method).pcd)
empty :=
space := $(empty) $(empty)
barred = $(subst $(space),|,$(strip $(1)))
no_captions := $(subst $(space),,$(foreach site,$(sites),$(foreach method,$(METHODS),|)))

folders := $(foreach name,$(names),$(foreach gripper,$(GRIPPERS),$(OUT)/$(name)/$(gripper)))
sections := $(foreach gripper,$(GRIPPERS),$(foreach method,$(METHODS),\
  $(OUT)/sections/$(gripper)_$(method).png))
results := $(sections) $(foreach gripper,$(GRIPPERS),$(OUT)/$(gripper).png) $(OUT)/pairs.csv \
  $(OUT)/maps.csv $(foreach folder,$(folders),$(folder)/summary/histograms.png)

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all FORCE
all: $(results)

$(OUT) $(OUT)/sections $(OUT)/sites $(folders):
	@mkdir -p $@

# Stamp files of the variables that results depend on, rewritten only if the variables change.
export scored_with := $(SCENARIO) $(SCORE) $(foreach gripper,$(GRIPPERS),$($(gripper)_mask) $($(gripper)_score))
export shown_with := $(sites) $(METHODS) $(GRIPPERS) $(CELL)
export simulated_with := $(COUNT) $(EDGE) $(SPACING)
$(foreach stamp,scored_with shown_with simulated_with,$(OUT)/$(stamp)): FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

$(OUT)/sites/primitive_shapes.pcd: $(OUT)/simulated_with | $(OUT)/sites
	@exec $(GRASPMAP) simulate scene --spacing $(SPACING) -o $@ --quiet

$(OUT)/sites/rocks/mesh.ply: $(OUT)/simulated_with | $(OUT)/sites
	@exec $(GRASPMAP) simulate site --edge-length $(EDGE) -o $(@D) --quiet

$(OUT)/sites/rocks.pcd: $(OUT)/sites/rocks/mesh.ply
	@exec $(GRASPMAP) resample $< --count $(COUNT) -o $@ --quiet

# Arguments: gripper, method.
define sections_of
$(OUT)/sections/$(1)_$(2).png: $(OUT)/scored_with | $(OUT)/sections
	@exec $(GRASPMAP) mask --gripper $(1) --method $(2) $($(1)_mask) --sections -o $$@ \
	  --quiet
endef
$(foreach gripper,$(GRIPPERS),$(foreach method,$(METHODS),$(eval \
  $(call sections_of,$(gripper),$(method)))))

# Arguments: name of the site, its cloud, gripper. make runs the maps in parallel, so each process uses
# one thread.
define maps_and_tables
$(OUT)/$(1)/$(3)/%.pcd: $(2) $(OUT)/scored_with | $(OUT)/$(1)/$(3)
	@exec $(GRASPMAP) score $$< -o $$@ --config $(SCENARIO) --gripper $(3) --method $$* --zero-plane -10 \
	  $($(3)_mask) $($(3)_score) $(SCORE) --threads 1 --quiet

$(OUT)/$(1)/$(3)/summary/pairs.csv $(OUT)/$(1)/$(3)/summary/maps.csv \
$(OUT)/$(1)/$(3)/summary/histograms.csv $(OUT)/$(1)/$(3)/summary/histograms.png &: $(call maps_of,$(1),$(3)) $(OUT)/shown_with
	@exec $(GRASPMAP) analyze $(call maps_of,$(1),$(3)) -o $(OUT)/$(1)/$(3)/summary --pairs \
	  --names "$(call barred,$(METHODS))" --quiet
endef
$(foreach site,$(sites),$(foreach gripper,$(GRIPPERS),$(eval \
  $(call maps_and_tables,$(call name_of,$(site)),$(call cloud_of,$(site)),$(gripper)))))

define sheet
$(OUT)/$(1).png: $(foreach name,$(names),$(call maps_of,$(name),$(1))) $(OUT)/shown_with
	@exec $(GRASPMAP) render $$(filter %.pcd,$$^) -o $$@ --columns $(words $(METHODS)) --quiet \
	  --cell-width $(CELL) --shared-view row --title '$(1)' \
	  --column-titles "$(call barred,$(METHODS))" --row-titles "$(call barred,$(names))" \
	  --captions "$(patsubst |%,%,$(no_captions))"
endef
$(foreach gripper,$(GRIPPERS),$(eval $(call sheet,$(gripper))))

# One table of all sites and grippers, with columns for both added in front.
joined = @rm -f $@.partial; for name in $(names); do for gripper in $(GRIPPERS); do \
  sed "1s/^/site,of_gripper,/; 2,\$$s/^/$$name,$$gripper,/" \
    $(OUT)/$$name/$$gripper/summary/$(@F) | { if [ -s $@.partial ]; then tail -n +2; else cat; fi; } \
    >> $@.partial || exit 1; done; done; mv $@.partial $@
$(OUT)/pairs.csv: $(foreach folder,$(folders),$(folder)/summary/pairs.csv)
	$(joined)
$(OUT)/maps.csv: $(foreach folder,$(folders),$(folder)/summary/maps.csv)
	$(joined)
endif
