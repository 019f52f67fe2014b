# Example without data: scenario 1 of the thesis (primitive shapes on a plane). The scene is simulated
# without errors and scored with the methods `thesis` and `corrected`. Both maps are looked up at 12
# locations and evaluated against the expected graspability of the locations.
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

# This spacing gives about as many points as the scan of this scene in the thesis.
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
