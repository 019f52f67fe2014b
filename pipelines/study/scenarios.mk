# Terrains and maps of the scenarios; included by study.mk.
#
# OUT/N_name/ contains the scene or site, terrain.pcd (pre-scanned), panorama.pcd (in situ) and one
# folder of site.mk per map: METHOD/prescan, METHOD/insitu_raw, METHOD/insitu_interpolated. real/
# contains such folders for the author's clouds.

# Map by site.mk, which recomputes only changed results. Arguments: folder, cloud, scenario, method,
# title, points, frame of the points, further flags of score.
define map
$(1)/map.pcd: $(2) $(6) FORCE
	@exec $$(MAKE) --no-print-directory -s -f $(here)site.mk SITE=$(strip $(2)) SCENARIO=$(strip $(3)) \
	  METHOD=$(strip $(4)) POINTS=$(strip $(6)) POINTS_FRAME=$(strip $(7)) SCORE='$(strip $(8))' OUT=$(1) \
	  SHARES=$(SHARES) GRASPMAP=$(GRASPMAP) TITLE='$(strip $(5))'
results += $(1)/map.pcd
endef

# Image. Arguments: image, rendered file, flags of render, title.
define picture
$(1): $(2)
	@exec $$(GRASPMAP) render $(2) -o $$@ $(3) --title '$(strip $(4))' --quiet
results += $(1)
endef

# --- 1: a pre-scanned scene with about as many points as the thesis's scan.
ifneq ($(filter 1,$(SCENARIOS)),)
points_1 := $(data)/field_test/primitive_shapes.csv
$(eval $(call stamp,$(folder_1)/simulated_with,$(SPACING) $(SEED)))
$(folder_1)/terrain.pcd: $(folder_1)/simulated_with
	@exec $(GRASPMAP) simulate scene --spacing $(SPACING) --seed $(SEED) -o $@
$(folder_1)/scene.ply: | $(folder_1)/simulated_with
	@exec $(GRASPMAP) simulate scene --mesh -o $@
$(eval $(call picture,$(folder_1)/scene.png,$(folder_1)/scene.ply,--view oblique --color single,\
  primitive shapes))
$(foreach method,$(METHODS),$(eval $(call map,$(folder_1)/$(method)/prescan,\
  $(folder_1)/terrain.pcd,primitive_shapes_prescan,$(method),primitive shapes: $(method),\
  $(points_1),input)))
endif

# --- 2 to 4: a site with its true mesh, leveled and cropped (the wall is rotated to horizontal, so that
# holds point up), samples of it, and the robot's view from its pose on the site.
site_2 := slopes_and_bumps
site_3 := bouldering_wall
site_4 := rocks
crop_2 := --level none --box=-2.7,-2.1,2.7,2.1
crop_3 := --up=0,-1,0 --center --box=-1.5,-1.5,1.5,1.5
crop_4 := --level none --box=-1.5,-1.5,1.5,1.5
scenario_2 := slopes_and_bumps_realtime
scenario_3 := bouldering_wall_prescan
scenario_4 := artificial_rocks_prescan
# Position of the robot: on the level floor beside the bumps, on the wall among the holds, in the free
# square. It sees only the cropped part of the wall.
pose_2 := --x -0.3 --y 0.1 --z 0.3
pose_3 := --x 0 --y 0 --z 0.3
pose_4 := --x 0 --y 0 --z 0.3
ground_2 := $(folder_2)/site/mesh.ply
ground_3 := $(folder_3)/site.ply
ground_4 := $(folder_4)/site/mesh.ply

# Argument: number of the scenario.
define site
$(call stamp,$(folder_$(1))/simulated_with,$(site_$(1)) $(SEED) $(EDGE))
$(call stamp,$(folder_$(1))/sampled_with,$(crop_$(1)) $(COUNT))
$(call stamp,$(folder_$(1))/seen_with,$(pose_$(1)) $(SENSOR) $(CAMERAS) $(PANORAMA))

$(folder_$(1))/site/mesh.ply $(folder_$(1))/site/field_points.csv &: $(folder_$(1))/simulated_with
	@exec $$(GRASPMAP) simulate site --site $(site_$(1)) --seed $$(SEED) --edge-length $$(EDGE) \
	  -o $(folder_$(1))/site
$(folder_$(1))/site.ply: $(folder_$(1))/site/mesh.ply $(folder_$(1))/sampled_with
	@exec $$(GRASPMAP) crop $$< -o $$@ $(crop_$(1))
$(folder_$(1))/terrain.pcd: $(folder_$(1))/site.ply $(folder_$(1))/sampled_with
	@exec $$(GRASPMAP) resample $$< -o $$@ --count $$(COUNT) --seed $$(SEED)
$(folder_$(1))/cameras.json: $(ground_$(1)) $(folder_$(1))/seen_with
	@exec $$(GRASPMAP) simulate cameras $$< $(pose_$(1)) $$(SENSOR) $$(CAMERAS) --seed $$(SEED) \
	  -o $(folder_$(1))/cameras
$(folder_$(1))/panorama.pcd: $(folder_$(1))/cameras.json
	@exec $$(GRASPMAP) fuse $(folder_$(1))/cameras -o $$@ $$(PANORAMA)
$(call picture,$(folder_$(1))/site.png,$(folder_$(1))/site.ply,--view oblique --color own,\
$(subst _, ,$(name_$(1))))
$(call picture,$(folder_$(1))/panorama.png,$(folder_$(1))/panorama.pcd,--view top --color height,\
$(subst _, ,$(name_$(1))): view of the robot)
endef

# Arguments: number of the scenario, method. Scenario 2 has no parameters for a pre-scanned map, so it
# uses those in situ, as does the author's equally sparse cloud.
define maps_of_site
$(call map,$(folder_$(1))/$(2)/prescan,$(folder_$(1))/terrain.pcd,$(scenario_$(1)),$(2),\
$(subst _, ,$(name_$(1))): pre-scanned: $(2),$(folder_$(1))/site/field_points.csv,map)
$(call map,$(folder_$(1))/$(2)/insitu_raw,$(folder_$(1))/panorama.pcd,$(name_$(1))_realtime,$(2),\
$(subst _, ,$(name_$(1))): in situ: raw: $(2),$(folder_$(1))/site/field_points.csv,map,\
--no-interpolation)
$(call map,$(folder_$(1))/$(2)/insitu_interpolated,$(folder_$(1))/panorama.pcd,\
$(name_$(1))_realtime,$(2),$(subst _, ,$(name_$(1))): in situ: interpolated: $(2),\
$(folder_$(1))/site/field_points.csv,map)
endef

sites := $(filter 2 3 4,$(SCENARIOS))
$(foreach n,$(sites),$(eval $(call site,$(n))) \
  $(foreach method,$(METHODS),$(eval $(call maps_of_site,$(n),$(method)))))

# --- The author's clouds. Arguments: number of the scenario, case, cloud, scenario, points, flags of
# score.
define real_map
$(call map,$(folder_$(1))/real/$(7)/$(2),$(clouds)/$(3),$(4),$(7),\
$(subst _, ,$(name_$(1))): cloud of the thesis: $(subst _, ,$(2)): $(7),$(5),input,$(6))
endef
real = $(if $(filter $(1),$(SCENARIOS)),$(foreach method,$(METHODS),\
  $(eval $(call real_map,$(1),$(2),$(3),$(4),$(5),$(6),$(method)))))
ifneq ($(clouds),)
$(call real,1,prescan,scanned_cloud_primitive.pcd,primitive_shapes_prescan,$(points_1))
$(call real,2,prescan,simulated_cloud_pre-scan.pcd,slopes_and_bumps_realtime)
$(call real,2,insitu_raw,scanned_cloud_realtime.pcd,slopes_and_bumps_realtime,,--no-interpolation)
$(call real,2,insitu_interpolated,scanned_cloud_realtime.pcd,slopes_and_bumps_realtime)
$(call real,4,prescan,artificial_rocks.pcd,artificial_rocks_prescan,\
  $(data)/field_test/artificial_rocks.csv)
endif
