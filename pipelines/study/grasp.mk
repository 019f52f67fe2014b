# The virtual field test of the scenarios, and what predicts it; included by study.mk.
#
# OUT/N_name/grasp/: PLACES places spread evenly over the terrain, the maps of all four methods
# looked up there, the verdicts of the virtual field test on the true mesh (table.csv), and how well
# each column predicts them at three loads (evaluation_LOAD/). `again` is the field test with another
# seed: nothing can predict better. `nz`, the normal's vertical part, is the slope alone.
# OUT/grasp_sweep/: the same of scenario 4 with other parameters of the field test.

grasp_methods := thesis envelope climblab corrected
grasp_score := $(foreach m,$(grasp_methods),$(m)_score)
grasp_columns := $(grasp_score) $(foreach m,$(grasp_methods),$(m)_convex $(m)_graspable) nz again_hold_probability
empty :=
space := $(empty) $(empty)
comma := ,
commas = $(subst $(space),$(comma),$(strip $(1)))

grasp_mesh_1 := $(folder_1)/scene.ply
grasp_scenario_1 := primitive_shapes_prescan
grasp_approach_1 := up
# Away from the border, where the gripper would be over nothing.
grasp_box_1 := -0.8,-0.8,0.8,0.8
grasp_box_2 := -2.5,-1.9,2.5,1.9
grasp_box_3 := -1.3,-1.3,1.3,1.3
grasp_box_4 := -1.3,-1.3,1.3,1.3
$(foreach n,2 3 4,$(eval grasp_mesh_$(n) := $(folder_$(n))/site.ply) \
  $(eval grasp_scenario_$(n) := $(scenario_$(n))))

# Scenario's number, method.
define grasp_lookup
$(folder_$(1))/grasp/map_$(2).pcd: $(folder_$(1))/terrain.pcd
	@mkdir -p $$(@D)
	@exec $$(GRASPMAP) score $$< --config $(grasp_scenario_$(1)) --method $(2) -o $$@ --quiet
$(folder_$(1))/grasp/with_$(2).csv: $(folder_$(1))/grasp/map_$(2).pcd $(3)
	@exec $$(GRASPMAP) lookup $$^ --points-frame input -o $$@ --quiet \
	  --column '$(2)_score=score,$(2)_convex=convex,$(2)_graspable=graspable'
endef

# Scenario's number.
define grasp_study
$(call stamp,$(folder_$(1))/grasp/placed_with,$(PLACES) $(SEED) $(TRIALS))
$(folder_$(1))/grasp/inner.ply: $(grasp_mesh_$(1)) $(folder_$(1))/grasp/placed_with
	@exec $$(GRASPMAP) crop $$< -o $$@ --level none --box=$(grasp_box_$(1)) --quiet
$(folder_$(1))/grasp/places.csv: $(folder_$(1))/grasp/inner.ply
	@exec $$(GRASPMAP) resample $$< -o $$@ --count $$(PLACES) --seed $$(SEED) --quiet
$(call grasp_lookup,$(1),thesis,$(folder_$(1))/grasp/places.csv)
$(call grasp_lookup,$(1),envelope,$(folder_$(1))/grasp/with_thesis.csv)
$(call grasp_lookup,$(1),climblab,$(folder_$(1))/grasp/with_envelope.csv)
$(call grasp_lookup,$(1),corrected,$(folder_$(1))/grasp/with_climblab.csv)
$(folder_$(1))/grasp/again.csv: $(grasp_mesh_$(1)) $(folder_$(1))/grasp/with_corrected.csv
	@exec $$(GRASPMAP) grasp $$< --points $$(word 2,$$^) -o $$@ $$(TRIALS) --best-draws 0 --seed 2 \
	  --prefix again_ --quiet
$(folder_$(1))/grasp/table.csv: $(grasp_mesh_$(1)) $(folder_$(1))/grasp/again.csv
	@exec $$(GRASPMAP) grasp $$< --points $$(word 2,$$^) -o $$@ $$(TRIALS) --load 10 \
	  --more-loads 5,30 --quiet
$(call grasp_evaluation,$(1),10,graspable)
$(call grasp_evaluation,$(1),5,graspable_5)
$(call grasp_evaluation,$(1),30,graspable_30)
endef

# Scenario's number, load, label.
define grasp_evaluation
$(folder_$(1))/grasp/evaluation_$(2)/accuracy.csv: $(folder_$(1))/grasp/table.csv
	@exec $$(GRASPMAP) evaluate $$< -o $$(@D) --label $(3) --score $(call commas,$(grasp_columns)) \
	  --cutoff 0.8 --bootstrap 1000 --title 'virtual field test at $(2) N: $(subst _, ,$(name_$(1)))' --quiet
results += $(folder_$(1))/grasp/evaluation_$(2)/accuracy.csv
endef

# Name, flags of grasp: scenario 4 with other parameters.
define grasp_sweep
$(OUT)/grasp_sweep/$(1)/accuracy.csv: $(grasp_mesh_4) $(folder_4)/grasp/again.csv
	@mkdir -p $(OUT)/grasp_sweep
	@$$(GRASPMAP) grasp $$< --points $$(word 2,$$^) -o $(OUT)/grasp_sweep/$(1).csv $$(TRIALS) \
	  --best-draws 0 $(2) --quiet && \
	exec $$(GRASPMAP) evaluate $(OUT)/grasp_sweep/$(1).csv -o $$(@D) --label graspable \
	  --score $(call commas,$(grasp_score) nz) --bootstrap 1000 --title '$(1)' --quiet
results += $(OUT)/grasp_sweep/$(1)/accuracy.csv
endef

ifneq ($(filter grasp,$(STAGES)),)
$(foreach n,$(SCENARIOS),$(eval $(call grasp_study,$(n))))
ifneq ($(filter 4,$(SCENARIOS)),)
$(eval $(call grasp_sweep,friction_0.25,--friction 0.25))
$(eval $(call grasp_sweep,friction_0.6,--friction 0.6))
$(eval $(call grasp_sweep,steeper_asperities,--asperity-min 30))
$(eval $(call grasp_sweep,flatter_asperities,--asperity-max 60))
$(eval $(call grasp_sweep,drag_2mm,--drag 2))
$(eval $(call grasp_sweep,closing_force_5,--set gripper.fingers.closing_force_n=5))
$(eval $(call grasp_sweep,closing_force_20,--set gripper.fingers.closing_force_n=20))
$(eval $(call grasp_sweep,four_fingers,--set gripper.fingers.count=4))
$(eval $(call grasp_sweep,curl_40,--set gripper.fingers.curl_deg=40))
$(eval $(call grasp_sweep,adhesion,--law adhesion))
$(eval $(call grasp_sweep,drives_give_way,--set gripper.fingers.holds_when_closed=false))
endif
endif
