# Graspability maps from a robot's bag. Results: the depth images of the bag; for each synchronized set
# of images, a cloud of all cameras (panorama), a map, footholds, an image, and a bag for RViz.
#
# BAG is a bag of ROS 1 (.bag) or ROS 2 (.mcap, or a folder of .db3). The written bags have the same
# format: map.bag, map.mcap, or a folder map_bag.
#
#   make -f pipelines/bag.mk BAG=robot.bag SCENARIO=artificial_rocks_realtime OUT=folder \
#        [EVERY=10] [BAG_FLAGS="--near 0.28 --far 1.5"] [METHOD=corrected] [SCORE="..."] -j2
#
# EVERY=n uses every n-th set of images. BAG_FLAGS are further flags of `graspmap convert`, for example
# topics, a rig or a depth range; SCORE and FOOTHOLDS are flags of `graspmap score` and `footholds`. A
# second run does nothing. If a variable changes, the results that depend on it are recomputed. Names
# must not contain spaces.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
SCENARIO ?= artificial_rocks_realtime
EVERY ?= 1
METHOD ?=
BAG_FLAGS ?=
SCORE ?=
FOOTHOLDS ?=

one_word = $(if $(word 2,$($(1))),$(error $(1) contains a space, which make cannot handle: $($(1))))
$(foreach name,BAG OUT SCENARIO,$(call one_word,$(name)))
ifeq ($(BAG),)
  $(error BAG is not set; set the bag of the robot, e.g. BAG=robot.bag)
endif
ifeq ($(OUT),)
  $(error OUT is not set; set the folder for the results, e.g. OUT=results)
endif

include $(here)one_run.mk
ifdef is_alone

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all sets moments FORCE
all: $(OUT)/images.json
	@exec $(MAKE) --no-print-directory -f $(here)bag.mk sets

$(OUT):
	@mkdir -p $@

# Stamp files of the variables that results depend on, rewritten only if the variables change.
export read_with := $(BAG) $(EVERY) $(BAG_FLAGS)
export scored_with := $(SCENARIO) $(METHOD) $(SCORE) $(FOOTHOLDS)
$(OUT)/read_with $(OUT)/scored_with: FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

# The folder's manifest is the target, because make compares the times of files.
$(OUT)/images.json: $(BAG) $(wildcard $(BAG)/*) $(OUT)/read_with
	@rm -rf $(OUT)/images
	@exec $(GRASPMAP) convert $(BAG) -o $(OUT)/images --every $(EVERY) $(BAG_FLAGS)

# Bag of a map. For a folder, its manifest is the target.
map_bag := $(if $(filter %.bag,$(BAG)),map.bag,$(if $(filter %.mcap,$(BAG)),map.mcap,map_bag.json))

# Stamps of the image sets. They are known only after the images exist, so `all` runs a second make.
stamps := $(shell tail -n +2 $(firstword $(wildcard $(OUT)/images/synchronized_sets.csv $(OUT)/images/moments.csv) /dev/null) | cut -d, -f1)
sets: $(foreach stamp,$(stamps),$(OUT)/$(stamp)/$(map_bag) $(OUT)/$(stamp)/top.png)
moments: sets  # earlier name

$(OUT)/%/panorama.pcd: $(OUT)/images.json
	@mkdir -p $(@D)
	@exec $(GRASPMAP) fuse $(OUT)/images --stamp $* -o $@

$(OUT)/%/map.pcd: $(OUT)/%/panorama.pcd $(OUT)/scored_with
	@exec $(GRASPMAP) score $< -o $@ --config $(SCENARIO) $(if $(METHOD),--method $(METHOD)) $(SCORE)

$(OUT)/%/footholds.csv: $(OUT)/%/map.pcd
	@exec $(GRASPMAP) footholds $< -o $@ $(FOOTHOLDS)

$(OUT)/%/$(map_bag): $(OUT)/%/map.pcd $(OUT)/%/footholds.csv
	@exec $(GRASPMAP) convert $< -o $(@:.json=) --terrain $(OUT)/$*/panorama.pcd --footholds $(OUT)/$*/footholds.csv

$(OUT)/%/top.png: $(OUT)/%/map.pcd
	@exec $(GRASPMAP) render $< -o $@ --view top --title "$* s" --quiet
endif
