# Inclination of the robot's body on the rocks (thesis, chapter 5.2.3); included by study.mk.
#
# OUT/4_artificial_rocks/poses/planes.csv: angle between the true ground and the regression plane of the
# robot's panorama, in degrees, with the body level and inclined by each of INCLINATIONS (degrees) to
# four sides. places_METHOD.csv: scores of the map without interpolation at the field test's locations
# that the robot measured at each pose.

ifneq ($(filter 4,$(SCENARIOS)),)
folder_poses := $(folder_4)/poses
poses := level $(foreach angle,$(INCLINATIONS),$(addsuffix _$(angle),forward backward left right))
direction_of = $(firstword $(subst _, ,$(1)))
angle_of = $(or $(word 2,$(subst _, ,$(1))),0)
turn_level :=
turn_forward = --pitch $(1)
turn_backward = --pitch -$(1)
turn_left = --roll -$(1)
turn_right = --roll $(1)

$(eval $(call stamp,$(folder_poses)/posed_with,$(METHODS) $(poses)))

# Argument: pose.
define pose
$(folder_poses)/$(1)/panorama.pcd: $(ground_4) $(folder_4)/seen_with
	@mkdir -p $$(@D)
	@exec $$(GRASPMAP) simulate cameras $$< $(pose_4) \
	  $(call turn_$(call direction_of,$(1)),$(call angle_of,$(1))) $$(SENSOR) $$(CAMERAS) \
	  --seed $$(SEED) -o $$(@D)/cameras --quiet
	@exec $$(GRASPMAP) fuse $$(@D)/cameras -o $$@ $$(PANORAMA) --quiet
endef
$(foreach one,$(poses),$(eval $(call pose,$(one))))

# Map, row of planes.csv and column of places_METHOD.csv. Arguments: pose, method, previous table.
define plane_of_pose
$(folder_poses)/$(1)/$(2).pcd: $(folder_poses)/$(1)/panorama.pcd
	@exec $$(GRASPMAP) score $$< -o $$@ --config artificial_rocks_realtime --method $(2) \
	  --no-interpolation --curvature-radius 0 --quiet
$(folder_poses)/$(1)/$(2).csv: $(folder_poses)/$(1)/$(2).pcd
	@set -- $$$$($$(GRASPMAP) info $$< | \
	  sed -n 's/^points: //p;s/^ *tilt_from_map_z_deg: //p') && \
	  printf '%s,%s,%s,%s,%.2f\n' $(call direction_of,$(1)) $(call angle_of,$(1)) $(2) $$$$1 $$$$2 \
	  > $$@.partial && mv $$@.partial $$@
$(folder_poses)/$(1)/places_$(2).csv: $(folder_poses)/$(1)/$(2).pcd $(3) \
    $(folder_4)/$(2)/looked_up_with
	@exec $$(GRASPMAP) lookup $$(wordlist 1,2,$$^) -o $$@ --points-frame map $$(LOOKUP) --quiet \
	  --visible $$(@D)/panorama.pcd --column '$(1)=score'
endef
$(foreach method,$(METHODS),\
  $(eval before := $(folder_4)/site/field_points.csv)\
  $(foreach one,$(poses),\
    $(eval $(call plane_of_pose,$(one),$(method),$(before)))\
    $(eval before := $(folder_poses)/$(one)/places_$(method).csv))\
  $(eval $(folder_poses)/places_$(method).csv: $(before)))

$(addprefix $(folder_poses)/places_,$(addsuffix .csv,$(METHODS))):
	@cp $< $@.partial && mv $@.partial $@

$(folder_poses)/planes.csv: $(folder_poses)/posed_with \
    $(foreach one,$(poses),$(foreach method,$(METHODS),$(folder_poses)/$(one)/$(method).csv))
	@echo direction,inclination_deg,method,voxels,plane_to_ground_deg > $@.partial
	@cat $(filter %.csv,$^) >> $@.partial
	@cat $@.partial
	@mv $@.partial $@
results += $(folder_poses)/planes.csv \
  $(addprefix $(folder_poses)/places_,$(addsuffix .csv,$(METHODS)))
endif
