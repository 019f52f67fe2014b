# A scan from its database to pictures: what it holds, one cloud of all its frames, the cloud's
# distance to a true mesh where there is one, and the graspability map with look-up and evaluation.
#
#   make -f pipelines/scan.mk SCAN=scan.db OUT=folder [POSES=odometry] [TRUTH=mesh.ply] \
#        [POINTS=points.csv] [SCENARIO=artificial_rocks_prescan] [METHOD=thesis] -j2
#
# SCAN is an RTAB-Map database or a folder of images. POSES is odometry, stored, ground-truth or a
# file of poses (stored). With TRUTH, a mesh in the frame of the scan's true poses, the cloud is
# carried into that frame. POINTS lie in the cloud's frame. FUSE and SCORE hold further flags.
# A second run does nothing; other variables or changed files make again what depends on them.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
POSES ?= stored
TRUTH ?=
POINTS ?=
SCENARIO ?= artificial_rocks_prescan
METHOD ?=
SHARES ?= 8
FUSE ?=
SCORE ?=
export TITLE ?= $(basename $(notdir $(SCAN)))

# make splits names at spaces; better an error than half a name.
one_word = $(if $(word 2,$($(1))),$(error $(1) holds a space, which make cannot handle: $($(1))))
$(foreach name,SCAN OUT POSES TRUTH POINTS SCENARIO,$(call one_word,$(name)))
ifeq ($(SCAN),)
  $(error SCAN is not set: the scan, e.g. SCAN=scan.db)
endif
ifeq ($(OUT),)
  $(error OUT is not set: the folder of the results, e.g. OUT=results)
endif

fuse_flags := --poses $(POSES) $(if $(TRUTH),--frame ground-truth) $(FUSE)
results := $(OUT)/scan.txt $(OUT)/cloud.png $(if $(TRUTH),$(OUT)/accuracy.txt)

.DELETE_ON_ERROR:
.PHONY: all map FORCE
all: $(results) map

$(OUT):
	@mkdir -p $@

# A stamp of the variables that the cloud depends on: written anew only if they change.
export fused_with := $(SCAN) $(fuse_flags)
$(OUT)/fused_with: FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

$(OUT)/scan.txt: $(SCAN) | $(OUT)
	@$(GRASPMAP) info $< > $@

$(OUT)/cloud.ply: $(SCAN) $(wildcard $(POSES)) $(OUT)/fused_with
	@$(GRASPMAP) fuse $(SCAN) -o $@ $(fuse_flags)

$(OUT)/cloud.png: $(OUT)/cloud.ply
	@$(GRASPMAP) render $< -o $@ --view oblique --color own --title "$$TITLE" --quiet

$(OUT)/accuracy.txt: $(OUT)/cloud.ply $(TRUTH)
	@$(GRASPMAP) compare $(OUT)/cloud.ply $(TRUTH) > $@
	@cat $@

map: $(OUT)/cloud.ply
	@$(MAKE) --no-print-directory -f $(here)site.mk SITE=$< POINTS=$(POINTS) SCENARIO=$(SCENARIO) \
	  METHOD=$(METHOD) OUT=$(OUT)/map SHARES=$(SHARES) SCORE="$(SCORE)" GRASPMAP=$(GRASPMAP)
