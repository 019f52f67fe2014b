# Graspability map of a site from its cloud, with look-up, evaluation and images.
#
#   make -f pipelines/site.mk SITE=cloud.pcd POINTS=points.csv SCENARIO=artificial_rocks_prescan \
#        OUT=folder [METHOD=thesis] [SHARES=8] [SCORE="..."] [POINTS_FRAME=map] [TITLE="..."] -j2
#
# POINTS is optional (columns x, y, z; first column: name). If it has a column `graspable` (1 or 0), the
# map is evaluated against it. POINTS are in the frame of the site, or with POINTS_FRAME=map in the frame
# of the map from which the site was cropped. SCENARIO is a name in data/scenarios or a file. METHOD
# replaces the scenario's method. SCORE are further flags of `graspmap score`, SHARES the number of
# threads of this command. A second run does nothing. A run that was stopped continues with the missing
# results. If a variable or a file changes, the results that depend on it are recomputed.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
SCENARIO ?= artificial_rocks_prescan
SHARES ?= 8
METHOD ?=
POINTS_FRAME ?= input
SCORE ?=
export TITLE ?= $(basename $(notdir $(SITE)))

# make splits names at spaces, so a name with a space is an error.
one_word = $(if $(word 2,$($(1))),$(error $(1) contains a space, which make cannot handle: $($(1))))
$(foreach name,SITE POINTS OUT SCENARIO,$(call one_word,$(name)))
ifeq ($(SITE),)
  $(error SITE is not set; set the cloud of the terrain, e.g. SITE=cloud.pcd)
endif
ifeq ($(OUT),)
  $(error OUT is not set; set the folder for the results, e.g. OUT=results)
endif
ifneq ($(shell test '$(SHARES)' -ge 1 2>/dev/null && echo yes),yes)
  $(error SHARES is '$(SHARES)': must be an integer >= 1)
endif
ifneq ($(POINTS)$(wildcard $(POINTS)),$(POINTS)$(POINTS))
  $(error POINTS is '$(POINTS)': no such file)
endif

include $(here)one_run.mk
ifdef is_alone

# Files of the scenario and of its gripper. If given by name, they are in data/, beside this folder.
data := $(firstword $(wildcard $(here)../data) $(here)..)
scenario_file := $(firstword $(wildcard $(SCENARIO) $(data)/scenarios/$(SCENARIO).yaml))
gripper := $(if $(scenario_file),$(shell sed -n 's/^gripper: *\([^ \#]*\).*/\1/p' $(scenario_file)))
gripper_file := $(firstword $(wildcard $(gripper) $(data)/grippers/$(gripper).yaml))

score_flags := --config $(SCENARIO) $(if $(METHOD),--method $(METHOD)) $(SCORE)
results := $(OUT)/map.pcd $(OUT)/map.vtp $(OUT)/top.png $(OUT)/oblique.png $(OUT)/curvature.png
markers :=
ifneq ($(POINTS),)
  results += $(OUT)/lookup.csv
  markers := --points $(POINTS) --points-frame $(POINTS_FRAME)
  columns := $(shell grep -v '^ *\#' '$(POINTS)' | head -n 1 | tr -d '\r' | tr ',' ' ')
  ifneq ($(filter graspable,$(columns)),)
    results += $(OUT)/roc.png
    markers += --verdict graspable
  endif
endif

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all FORCE
all: $(results)

$(OUT):
	@mkdir -p $@

# Stamp files of the variables that results depend on, rewritten only if the variables change.
export scored_with := $(SITE) $(score_flags)
export shown_with := $(POINTS) $(POINTS_FRAME) $(TITLE)
$(OUT)/scored_with $(OUT)/shown_with: FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

$(OUT)/map.pcd: $(SITE) $(OUT)/scored_with $(scenario_file) $(gripper_file)
	@exec $(GRASPMAP) score $(SITE) -o $@ $(score_flags) --threads $(SHARES)

$(OUT)/map.vtp: $(OUT)/map.pcd
	@exec $(GRASPMAP) convert $< -o $@ --quiet

$(OUT)/lookup.csv: $(OUT)/map.pcd $(POINTS) $(OUT)/shown_with
	@exec $(GRASPMAP) lookup $< $(POINTS) --points-frame $(POINTS_FRAME) -o $@

$(OUT)/roc.png: $(OUT)/lookup.csv
	@exec $(GRASPMAP) evaluate $< -o $(OUT)/evaluation --label graspable --score score --quiet \
	  --title "$$TITLE"
	@cp $(OUT)/evaluation/roc.png $@.partial && mv $@.partial $@

$(OUT)/top.png: $(OUT)/map.pcd $(POINTS) $(OUT)/shown_with
	@exec $(GRASPMAP) render $< -o $@ --view top $(markers) --title "$$TITLE" --quiet

$(OUT)/oblique.png: $(OUT)/map.pcd $(OUT)/shown_with
	@exec $(GRASPMAP) render $< -o $@ --view oblique --title "$$TITLE" --quiet

$(OUT)/curvature.png: $(OUT)/map.pcd $(OUT)/shown_with
	@exec $(GRASPMAP) render $< -o $@ --view top --color flags --title "$$TITLE: convex areas" --quiet
endif
