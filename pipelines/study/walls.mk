# Map of the steep sides of the rocks (thesis, chapter 6.2); included by study.mk.
#
# OUT/4_artificial_rocks/walls/: the pre-scanned map with the mask along the surface normal and with
# flags of obstacles (surface/), the map's footholds, and the changes against the upright mask
# (analysis/).

ifneq ($(and $(filter walls,$(STAGES)),$(filter 4,$(SCENARIOS)),$(filter corrected,$(METHODS))),)
folder_walls := $(folder_4)/walls
surface_map := $(folder_walls)/surface/map.pcd
upright_map := $(folder_4)/corrected/prescan/map.pcd
$(eval $(call map,$(folder_walls)/surface,$(folder_4)/terrain.pcd,artificial_rocks_prescan,corrected,\
  artificial rocks: mask along the surface,$(folder_4)/site/field_points.csv,map,\
  --orientation surface --obstacle-height $(OBSTACLE_HEIGHT)))
$(eval $(call picture,$(folder_walls)/obstacles.png,$(surface_map),--view oblique --color flags,\
  artificial rocks: obstacles))
$(folder_walls)/footholds.csv: $(surface_map)
	@exec $(GRASPMAP) footholds $< -o $@
$(folder_walls)/analysis/summary.json: $(surface_map) $(upright_map)
	@exec $(GRASPMAP) analyze $^ -o $(@D)
results += $(folder_walls)/footholds.csv $(folder_walls)/analysis/summary.json
endif
