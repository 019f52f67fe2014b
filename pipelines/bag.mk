# A robot's bag to maps: its depth images, and of each moment a panorama, a graspability map,
# footholds, a picture, and a bag that RViz shows.
#
# BAG is a bag of ROS 1 (.bag) or ROS 2 (.mcap, or a folder of .db3); the bags written are of its kind:
# map.bag, map.mcap, or a folder map_bag.
#
#   make -f pipelines/bag.mk BAG=robot.bag SCENARIO=artificial_rocks_realtime OUT=folder \
#        [EVERY=10] [BAG_FLAGS="--near 0.28 --far 1.5"] [METHOD=corrected] [SCORE="..."] -j2
#
# EVERY takes every n-th moment of the bag. BAG_FLAGS are further flags of `graspmap convert`, such as
# topics, a rig, a range; FOOTHOLDS of `graspmap footholds`. A second run does nothing; other variables make again
# what depends on them. Names must not hold spaces.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
SCENARIO ?= artificial_rocks_realtime
EVERY ?= 1
METHOD ?=
BAG_FLAGS ?=
SCORE ?=
FOOTHOLDS ?=

one_word = $(if $(word 2,$($(1))),$(error $(1) holds a space, which make cannot handle: $($(1))))
$(foreach name,BAG OUT SCENARIO,$(call one_word,$(name)))
ifeq ($(BAG),)
  $(error BAG is not set: the robot's bag, e.g. BAG=robot.bag)
endif
ifeq ($(OUT),)
  $(error OUT is not set: the folder of the results, e.g. OUT=results)
endif

include $(here)one_run.mk
ifdef is_alone

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all moments FORCE
all: $(OUT)/images.json
	@exec $(MAKE) --no-print-directory -f $(here)bag.mk moments

$(OUT):
	@mkdir -p $@

# Stamps of the variables that a result depends on: written anew only if they change.
export read_with := $(BAG) $(EVERY) $(BAG_FLAGS)
export scored_with := $(SCENARIO) $(METHOD) $(SCORE) $(FOOTHOLDS)
$(OUT)/read_with $(OUT)/scored_with: FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

# The folder's manifest stands for the folder.
$(OUT)/images.json: $(BAG) $(wildcard $(BAG)/*) $(OUT)/read_with
	@rm -rf $(OUT)/images
	@exec $(GRASPMAP) convert $(BAG) -o $(OUT)/images --every $(EVERY) $(BAG_FLAGS)

# The bag of a map; its manifest stands for a folder.
map_bag := $(if $(filter %.bag,$(BAG)),map.bag,$(if $(filter %.mcap,$(BAG)),map.mcap,map_bag.json))

# Known once the images are there.
stamps := $(shell tail -n +2 $(firstword $(wildcard $(OUT)/images/synchronized_sets.csv $(OUT)/images/moments.csv) /dev/null) | cut -d, -f1)
moments: $(foreach stamp,$(stamps),$(OUT)/$(stamp)/$(map_bag) $(OUT)/$(stamp)/top.png)

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
