# Graspability map from a scan's database: one cloud of all frames, a clean surface, the leveled and
# cropped site with its photographs as texture, uniform samples of the site, and the map with look-up,
# evaluation and images. With TRUTH, also measures the distances of cloud and site to the true mesh.
#
#   make -f pipelines/scan.mk SCAN=scan.db OUT=folder [POSES=odometry] [TRUTH=mesh.ply] \
#        [CROP="--size 3x3"] [RESAMPLE="--count 73000"] [POINTS=points.csv] \
#        [SCENARIO=artificial_rocks_prescan] [METHOD=thesis] [TILES=5] -j2
#
# SCAN is an RTAB-Map database or a folder of images. POSES is refined (by graspmap refine), odometry,
# optimized, ground-truth or a file of poses (default: optimized). TRUTH is a mesh in the frame of the
# scan's true poses; the cloud is transformed into that frame. POINTS are in the frame of the cloud.
# REFINE, FUSE, MESH, CROP, RESAMPLE and SCORE are further flags of the commands of these names. Without
# CROP, the site is leveled but not cropped. An empty TEXTURE omits the texture. TILES is the side of a
# tile in meters: cloud, mesh, site and terrain are then folders of tiles and the map is a tile store, so
# that memory does not depend on the area. With TILES, there is a texture only if TEXTURE=model requests
# a folder of models; no image shows it. CROP cannot be --size or --border if the site is too large for
# memory. A second run does nothing. If a variable or a file changes, the results that depend on it are
# recomputed. The target `world` writes a simulation world of the site, with the texture if there is one;
# WORLD are further flags of `graspmap convert`.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
POSES ?= optimized
TRUTH ?=
POINTS ?=
SCENARIO ?= artificial_rocks_prescan
METHOD ?=
SHARES ?= 8
REFINE ?=
FUSE ?=
MESH ?= --cell-size 0.01
CROP ?=
RESAMPLE ?=
TILES ?=
TEXTURE ?= $(if $(TILES),,model.glb)
SCORE ?=
WORLD ?=
export TITLE ?= $(basename $(notdir $(SCAN)))

# make splits names at spaces, so a name with a space is an error.
one_word = $(if $(word 2,$($(1))),$(error $(1) contains a space, which make cannot handle: $($(1))))
$(foreach name,SCAN OUT POSES TRUTH POINTS SCENARIO TEXTURE TILES,$(call one_word,$(name)))
ifeq ($(SCAN),)
  $(error SCAN is not set; set the scan, e.g. SCAN=scan.db)
endif
ifeq ($(OUT),)
  $(error OUT is not set; set the folder for the results, e.g. OUT=results)
endif

include $(here)one_run.mk
ifdef is_alone

refined := $(if $(filter refined,$(POSES)),$(OUT)/poses.tum)
poses := $(or $(refined),$(POSES))
true_frame := $(if $(TRUTH),--frame ground-truth)
poses_flags := --poses $(poses) $(true_frame)
cloud := $(OUT)/cloud$(if $(TILES),,.ply)
mesh := $(OUT)/mesh$(if $(TILES),,.ply)
site := $(OUT)/site$(if $(TILES),,.ply)
terrain := $(OUT)/terrain$(if $(TILES),,.pcd)
tile_flag := $(if $(TILES),--tile-size $(TILES))
# Only a cropped site has straight edges to check.
pictures := $(OUT)/cloud.png $(OUT)/site.png $(if $(CROP),$(OUT)/spot_check.txt) \
  $(if $(TEXTURE),$(OUT)/texture.png)
results := $(OUT)/scan.txt $(if $(TILES),$(addprefix $(OUT)/,$(TEXTURE)),$(pictures)) \
  $(if $(TRUTH),$(OUT)/accuracy.txt)

.DELETE_ON_ERROR:
.PHONY: all map world FORCE
all: $(results) map

$(OUT):
	@mkdir -p $@

# Stamp files of the variables that results depend on, rewritten only if the variables change.
export fused_with := $(SCAN) $(poses_flags) $(tile_flag) $(FUSE)
export refined_with := $(SCAN) $(REFINE)
export checked_with := $(TRUTH)
export meshed_with := $(tile_flag) $(MESH)
export cropped_with := $(CROP)
export resampled_with := $(RESAMPLE)
score_flags := --config $(SCENARIO) $(if $(METHOD),--method $(METHOD)) $(SCORE)
export scored_with := $(score_flags)
export converted_with := $(WORLD)
stamps := $(addprefix $(OUT)/,refined_with fused_with meshed_with cropped_with resampled_with \
  scored_with checked_with converted_with)
$(stamps): FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

$(OUT)/scan.txt: $(SCAN) $(OUT)/refined_with
	@exec $(GRASPMAP) info $< > $@.partial
	@mv $@.partial $@

$(OUT)/poses.tum $(OUT)/refinement.json &: $(SCAN) $(OUT)/refined_with
	@exec $(GRASPMAP) refine $< -o $(OUT)/poses.tum --report $(OUT)/refinement.json \
	  $(REFINE)

# `fuse` corrects the poses, so the images match the cloud only with the corrected poses.
$(cloud) $(OUT)/fused_poses.tum &: $(SCAN) $(or $(refined),$(wildcard $(POSES))) \
    $(OUT)/fused_with
	@exec $(GRASPMAP) fuse $(SCAN) -o $(cloud) --corrected-poses $(OUT)/fused_poses.tum \
	  $(poses_flags) $(tile_flag) $(FUSE)

ifdef TILES
$(mesh): $(cloud) $(OUT)/meshed_with
	@exec $(GRASPMAP) mesh $< -o $@ $(tile_flag) $(MESH)
else
$(mesh) $(OUT)/mesh.txt &: $(cloud) $(OUT)/meshed_with
	@exec $(GRASPMAP) mesh $< -o $(mesh) --report $(MESH) > $(OUT)/mesh.txt.partial
	@mv $(OUT)/mesh.txt.partial $(OUT)/mesh.txt
endif

$(site): $(mesh) $(OUT)/cropped_with
	@exec $(GRASPMAP) crop $< -o $@ $(CROP)

$(terrain): $(site) $(OUT)/resampled_with
	@exec $(GRASPMAP) resample $< -o $@ $(RESAMPLE)

$(OUT)/$(TEXTURE): $(site) $(SCAN) $(OUT)/fused_poses.tum
	@exec $(GRASPMAP) texture $< --scan $(SCAN) --poses $(OUT)/fused_poses.tum $(true_frame) -o $@

world: $(OUT)/site.world.json
$(OUT)/site.world.json: $(if $(TEXTURE),$(OUT)/$(TEXTURE),$(site)) $(OUT)/converted_with
	@exec $(GRASPMAP) convert $< -o $(OUT)/site.world $(WORLD)

$(OUT)/cloud.png: $(cloud)
	@exec $(GRASPMAP) render $< -o $@ --view oblique --color own --title "$$TITLE: cloud" --quiet

$(OUT)/site.png: $(site)
	@exec $(GRASPMAP) render $< -o $@ --view oblique --color own --title "$$TITLE: site" --quiet

$(OUT)/texture.png: $(OUT)/$(TEXTURE)
	@exec $(GRASPMAP) render $< -o $@ --view oblique --title "$$TITLE: textured" --quiet

# Without a true mesh, heights are measured from the fitted plane.
$(OUT)/spot_check.txt: $(site) $(TRUTH) $(OUT)/checked_with
	@exec $(GRASPMAP) compare $< --edges -o $(OUT)/spot_check.csv $(if $(TRUTH),--truth $(TRUTH) \
	  --truth-frame map) > $@.partial
	@mv $@.partial $@

$(OUT)/accuracy.txt: $(cloud) $(site) $(TRUTH) $(OUT)/checked_with
	@echo 'cloud:' > $@.partial
	@exec $(GRASPMAP) compare $(cloud) $(TRUTH) >> $@.partial
	@echo 'surface of the site:' >> $@.partial
	@exec $(GRASPMAP) compare $(site) $(TRUTH) --transform crop > $@.site
	@sed '/^surface within/d' $@.site >> $@.partial
	@cat $@.partial
	@rm $@.site
	@mv $@.partial $@

ifdef TILES
# A tile store is resumed. It is recomputed if the terrain or a variable changes.
$(OUT)/map.begun: $(terrain) $(OUT)/scored_with
	@rm -rf $(OUT)/map.tiles && touch $@

$(OUT)/map.tiles/index.json: $(OUT)/map.begun
	@exec $(GRASPMAP) score $(terrain) -o $(OUT)/map.tiles $(score_flags)

$(OUT)/map.png: $(OUT)/map.tiles/index.json
	@exec $(GRASPMAP) render $(OUT)/map.tiles -o $@ --view top --title "$$TITLE" --quiet

map: $(OUT)/map.png
else
map: $(terrain)
	@exec $(MAKE) --no-print-directory -f $(here)site.mk SITE=$< POINTS=$(POINTS) POINTS_FRAME=map \
	  SCENARIO=$(SCENARIO) METHOD=$(METHOD) OUT=$(OUT)/map SHARES=$(SHARES) SCORE="$(SCORE)" \
	  GRASPMAP=$(GRASPMAP)
endif
endif
