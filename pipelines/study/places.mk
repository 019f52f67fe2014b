# Look-up of the field test's locations in every map of scenarios 2 to 4; included by study.mk.
#
# OUT/N_name/METHOD/table.csv has one row per location and one column per case, as tables B 2-3 of the
# thesis (score at the location; 1 or 0 by score and convexity combined) and, for the wall, B 2-4
# (graspability of a hold). In situ, a location has a value only if the robot measured a point near it.
# The wall's cases are evaluated against its pre-scanned map: METHOD/evaluation/.

# Field of the map (by_...) and flags of the look-up (look_by_...), for the score and for the combined
# criterion. A hold is graspable by the score if its best score reaches 0.9, and by the combined criterion
# if any of its voxels is convex and reaches the threshold.
by_score_2 := score
by_score_3 := score>=0.9
by_score_4 := score
by_both_2 := graspable
by_both_3 := graspable>=0.0001
by_both_4 := graspable
look_by_score_2 := $(LOOKUP)
look_by_both_2 := $(LOOKUP)
look_by_score_3 := --mode maximum --radius $(HOLD_RADIUS)
look_by_both_3 := --mode mean --radius $(HOLD_RADIUS)
look_by_score_4 := $(LOOKUP)
look_by_both_4 := $(LOOKUP)

# One column. Arguments: number of the scenario, method, column, case, by_score or by_both, flags,
# previous table.
define column
$(folder_$(1))/$(2)/places/$(3).csv: $(folder_$(1))/$(2)/$(4)/map.pcd $(7) \
    $(folder_$(1))/$(2)/looked_up_with
	@mkdir -p $$(@D)
	@exec $$(GRASPMAP) lookup $$(wordlist 1,2,$$^) -o $$@ --points-frame map $(look_$(5)_$(1)) \
	  $(6) --column '$(3)=$($(5)_$(1))' --quiet
endef

# Arguments: number of the scenario, method.
define places
$(call stamp,$(folder_$(1))/$(2)/looked_up_with,$(look_by_score_$(1)) $(by_score_$(1)))
$(call column,$(1),$(2),prescan,prescan,by_score,,$(folder_$(1))/site/field_points.csv)
$(call column,$(1),$(2),prescan_combined,prescan,by_both,,$(folder_$(1))/$(2)/places/prescan.csv)
$(call column,$(1),$(2),realtime_raw,insitu_raw,by_score,--visible $(folder_$(1))/panorama.pcd,\
$(folder_$(1))/$(2)/places/prescan_combined.csv)
$(call column,$(1),$(2),realtime_interpolated,insitu_interpolated,by_score,\
--visible $(folder_$(1))/panorama.pcd,$(folder_$(1))/$(2)/places/realtime_raw.csv)
$(call column,$(1),$(2),realtime_combined,insitu_interpolated,by_both,\
--visible $(folder_$(1))/panorama.pcd,$(folder_$(1))/$(2)/places/realtime_interpolated.csv)
$(folder_$(1))/$(2)/table.csv: $(folder_$(1))/$(2)/places/realtime_combined.csv
	@cp $$< $$@.partial && mv $$@.partial $$@
results += $(folder_$(1))/$(2)/table.csv
endef
$(foreach n,$(sites),$(foreach method,$(METHODS),$(eval $(call places,$(n),$(method)))))

# Argument: method.
define wall_evaluation
$(folder_3)/$(1)/evaluation/accuracy.csv: $(folder_3)/$(1)/table.csv
	@exec $$(GRASPMAP) evaluate $$< -o $$(@D) --label prescan --title 'against the pre-scanned map' \
	  --score prescan_combined,realtime_raw,realtime_interpolated,realtime_combined --quiet
results += $(folder_3)/$(1)/evaluation/accuracy.csv
endef
$(if $(filter 3,$(SCENARIOS)),$(foreach method,$(METHODS),$(eval $(call wall_evaluation,$(method)))))
