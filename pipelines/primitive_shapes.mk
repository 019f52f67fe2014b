# Example without data: the thesis's scenario 1 (primitive shapes on a plane) is simulated without errors,
# scored with the methods `thesis` and `corrected`, looked up at 12 locations and evaluated against their
# expected graspability.
#
#   make -f pipelines/primitive_shapes.mk OUT=folder [SHARES=4] -j2

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
OUT ?= demo
SHARES ?= 4
SPACING ?= 0.0068
points := $(here)../data/field_test/primitive_shapes.csv
ifeq ($(wildcard $(points)),)
  points := $(here)../field_test/primitive_shapes.csv
endif
methods := thesis corrected

include $(here)one_run.mk
ifdef is_alone

.DELETE_ON_ERROR:
.PHONY: all $(methods)
all: $(OUT)/scene.png $(methods)

$(OUT):
	@mkdir -p $@

# About as many points as in the thesis's scan of this scene.
$(OUT)/terrain.pcd: | $(OUT)
	@exec $(GRASPMAP) simulate scene --spacing $(SPACING) -o $@

$(OUT)/scene.ply: | $(OUT)
	@exec $(GRASPMAP) simulate scene --mesh -o $@

$(OUT)/scene.png: $(OUT)/scene.ply
	@exec $(GRASPMAP) render $< -o $@ --view oblique --color single --title 'primitive shapes' --quiet

$(methods): $(OUT)/terrain.pcd
	@exec $(MAKE) --no-print-directory -f $(here)site.mk SITE=$< POINTS=$(points) \
	  SCENARIO=primitive_shapes_prescan METHOD=$@ OUT=$(OUT)/$@ SHARES=$(SHARES) \
	  GRASPMAP=$(GRASPMAP) TITLE='primitive shapes, $@'
endif
