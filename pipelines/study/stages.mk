# Stages after the scenarios: published tables, thresholds, masks, report; included by study.mk.

# --- The thesis's published tables: B 2-3 against the verdicts of the field test, also with the cutoff
# for its interpolated case, and B 2-4 against the pre-scanned map.
insitu_cases := realtime_raw,realtime_interpolated,realtime_combined
cases_artificial_rocks := prescan,$(insitu_cases)
cases_artificial_rocks_interpolated := realtime_interpolated
cases_bouldering_wall := prescan_combined,$(insitu_cases)
# Arguments: folder, table, label, cutoff.
define published
$(OUT)/published/$(1)/accuracy.csv: $(tables)/$(2)
	@mkdir -p $(OUT)/published
	@exec $$(GRASPMAP) evaluate $$< -o $$(@D) --label $(3) --score $(cases_$(1)) --cutoff $(4) --quiet \
	  --title 'published: $(subst _, ,$(1))'
results += $(OUT)/published/$(1)/accuracy.csv
endef
ifneq ($(and $(filter published,$(STAGES)),$(tables)),)
$(eval $(call published,artificial_rocks,field_test_scenario4.csv,graspable,0.8))
$(eval $(call published,artificial_rocks_interpolated,field_test_scenario4.csv,graspable,0.6))
$(eval $(call published,bouldering_wall,bouldering_wall_scenario3.csv,prescan,0.5))
endif

# --- Threshold study on scenario 1, and masks on the terrains of all scenarios.
ifneq ($(and $(filter thresholds,$(STAGES)),$(filter 1,$(SCENARIOS))),)
$(OUT)/thresholds/thresholds.csv: $(folder_1)/terrain.pcd $(data)/expected/primitive_shapes.csv FORCE
	@exec $(MAKE) --no-print-directory -s -f $(here)thresholds.mk OUT=$(@D) SITE=$< \
	  EXPECTED=$(word 2,$^) METHODS='$(METHODS)' GRASPMAP=$(GRASPMAP) TITLE='primitive shapes'
results += $(OUT)/thresholds/thresholds.csv
endif
ifneq ($(filter masks,$(STAGES)),)
mask_sites := $(foreach n,$(SCENARIOS),$(name_$(n)):$(folder_$(n))/terrain.pcd)
$(OUT)/masks/pairs.csv: $(foreach n,$(SCENARIOS),$(folder_$(n))/terrain.pcd) FORCE
	@exec $(MAKE) --no-print-directory -s -f $(here)masks.mk OUT=$(@D) SITES='$(mask_sites)' \
	  METHODS='thesis envelope climblab corrected' GRASPMAP=$(GRASPMAP)
results += $(OUT)/masks/pairs.csv
endif

# --- Report of all existing results.
ifneq ($(filter report,$(STAGES)),)
all: $(OUT)/report.html
endif
$(OUT)/findings.txt: $(here)study/findings.txt
	@mkdir -p $(@D)
	@cp $< $@
$(OUT)/report.html: $(OUT)/findings.txt $(results)
	@exec $(GRASPMAP) report $(OUT) --title 'The study of the thesis' --max-size-mb 60 -o $@
