# A site from its cloud to pictures: graspability map tile by tile, look-up, evaluation, pictures.
#
#   make -f pipelines/site.mk SITE=cloud.pcd POINTS=points.csv SCENARIO=artificial_rocks_prescan \
#        OUT=folder [METHOD=thesis] [SHARES=8] [SCORE="..."] [TITLE="..."] -j2
#
# POINTS (columns x, y, z; first column: name) may be left out; if it has a column `graspable` (1 or
# 0), the map is evaluated against it. SCENARIO is a name of data/scenarios or a file. METHOD, if
# set, replaces the scenario's method. A second run does nothing; a run that was stopped goes on.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
SCENARIO ?= artificial_rocks_prescan
SHARES ?= 8
METHOD ?=
SCORE ?=
TITLE ?= $(basename $(notdir $(SITE)))

ifeq ($(strip $(SITE)),)
  $(error SITE is not set: the cloud of the terrain, e.g. SITE=cloud.pcd)
endif
ifeq ($(strip $(OUT)),)
  $(error OUT is not set: the folder of the results, e.g. OUT=results)
endif

score_flags := --config $(SCENARIO) $(if $(METHOD),--method $(METHOD)) $(SCORE)
tiles := $(foreach k,$(shell seq $(SHARES)),$(OUT)/tiles/$(k)-of-$(SHARES).pcd)
pictures := $(OUT)/top.png $(OUT)/oblique.png $(OUT)/curvature.png
results := $(OUT)/map.pcd $(OUT)/map.vtp $(pictures)
markers :=
ifneq ($(strip $(POINTS)),)
  results += $(OUT)/lookup.csv
  header := $(shell grep -v '^ *\#' '$(POINTS)' | head -n 1 | tr -d '\r' | tr ',' ' ')
  ifneq ($(filter graspable,$(header)),)
    results += $(OUT)/roc.png
    markers := --points $(POINTS) --verdict graspable
  else
    markers := --points $(POINTS)
  endif
endif

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all FORCE
all: $(results)

$(OUT) $(OUT)/tiles:
	@mkdir -p $@

# Other parameters make other tiles: the file changes only if they do.
$(OUT)/parameters: FORCE | $(OUT)
	@echo '$(score_flags)' | cmp -s - $@ || echo '$(score_flags)' > $@

# make runs the shares side by side: each process takes one thread.
$(OUT)/tiles/%-of-$(SHARES).pcd: $(SITE) $(OUT)/parameters $(wildcard $(SCENARIO)) | $(OUT)/tiles
	@$(GRASPMAP) score $(SITE) -o $@ $(score_flags) --tile $*/$(SHARES) --threads 1 --quiet

$(OUT)/map.pcd: $(tiles)
	@$(GRASPMAP) merge $(tiles) -o $@

$(OUT)/map.vtp: $(OUT)/map.pcd
	@$(GRASPMAP) convert $< $@ --quiet

$(OUT)/lookup.csv: $(OUT)/map.pcd $(POINTS)
	@$(GRASPMAP) lookup $< $(POINTS) -o $@

# The chart is the last file of the evaluation's folder that is put in place.
$(OUT)/roc.png: $(OUT)/lookup.csv
	@$(GRASPMAP) evaluate $< -o $(OUT)/evaluation --label graspable --score score --quiet \
	  --title '$(TITLE)'
	@cp $(OUT)/evaluation/roc.png $@

$(OUT)/top.png: $(OUT)/map.pcd $(POINTS)
	@$(GRASPMAP) render $< -o $@ --view top --color score $(markers) --title '$(TITLE)' --quiet

$(OUT)/oblique.png: $(OUT)/map.pcd
	@$(GRASPMAP) render $< -o $@ --view oblique --color score --title '$(TITLE)' --quiet

$(OUT)/curvature.png: $(OUT)/map.pcd
	@$(GRASPMAP) render $< -o $@ --view top --color flags --title '$(TITLE): convex areas' --quiet
