# Virtual field test of the scenarios (simulated grasps), and evaluation of the maps as predictors of its
# verdicts; included by study.mk.
#
# OUT/N_name/grasp/table.csv: PLACES locations spread evenly over the terrain, the values of the maps of
# all methods there, and the verdicts on the true mesh. For comparison, columns `again`: the field test
# with another seed, the upper bound of any prediction; `nz`: vertical component of the normal; `scanned`
# (scenario 4): the field test on the surface of a simulated scan of the site.
# OUT/N_name/grasp/evaluation_LOAD/: each column as a predictor of the verdicts at one of three loads.
# OUT/grasp_real/: the field test on surfaces of the author's clouds; bouldering holds: with HubRobo.
# OUT/grasp_sweep/: scenario 4 with other parameters of the field test.

grasp_methods := thesis envelope climblab corrected calibrated
grasp_score := $(foreach m,$(grasp_methods),$(m)_score)
grasp_columns := $(grasp_score) $(foreach m,$(grasp_methods),$(m)_convex $(m)_graspable) nz again_hold_probability
empty :=
space := $(empty) $(empty)
comma := ,
commas = $(subst $(space),$(comma),$(strip $(1)))

grasp_mesh_1 := $(folder_1)/scene.ply
grasp_scenario_1 := primitive_shapes_prescan
$(foreach n,1 2 3 4,$(eval grasp_cloud_$(n) := $(folder_$(n))/terrain.pcd))
# Boxes that keep locations away from the border, beyond which fingers have no ground below them.
grasp_box_1 := -0.8,-0.8,0.8,0.8
grasp_box_2 := -2.5,-1.9,2.5,1.9
grasp_box_3 := -1.3,-1.3,1.3,1.3
grasp_box_4 := -1.3,-1.3,1.3,1.3
$(foreach n,2 3 4,$(eval grasp_mesh_$(n) := $(folder_$(n))/site.ply) \
  $(eval grasp_scenario_$(n) := $(scenario_$(n))))

# Scenarios 5 to 7 are the author's clouds.
names_real := artificial_rocks primitive_shapes bouldering_holds
$(foreach n,1 2 3,$(eval name_$(words 1 2 3 4 $(wordlist 1,$(n),1 2 3)) := thesis_$(word $(n),$(names_real))))
$(foreach n,5 6 7,$(eval folder_$(n) := $(OUT)/grasp_real/$(name_$(n))) \
  $(eval grasp_mesh_$(n) := $(folder_$(n))/mesh.ply))
grasp_cloud_5 := $(clouds)/artificial_rocks.pcd
grasp_cloud_6 := $(clouds)/scanned_cloud_primitive.pcd
grasp_cloud_7 := $(folder_7)/terrain.pcd
grasp_scenario_5 := artificial_rocks_prescan
grasp_scenario_6 := primitive_shapes_prescan
grasp_scenario_7 := bouldering_wall_prescan
grasp_box_5 := -1.3,-1.3,1.3,1.3
grasp_box_6 := -1.2,-1.2,1.2,1.2
grasp_box_7 := -0.25,-0.32,0.25,0.32
grasp_mesh_flags_6 := --normals estimate
# Parameters as in masks.mk.
grasp_flags_7 := --gripper hubrobo
grasp_score_flags_7 := --gripper hubrobo --voxel-size 0.005 --solid-voxel-threshold 4 \
  --curvature-radius 0.03 --set interpolation=yes

# Arguments: number of the scenario, method.
define grasp_lookup
$(folder_$(1))/grasp/map_$(2).pcd: $(grasp_cloud_$(1))
	@mkdir -p $$(@D)
	@exec $$(GRASPMAP) score $$< --config $(grasp_scenario_$(1)) --method $(2) \
	  $(grasp_score_flags_$(1)) -o $$@ --quiet
$(folder_$(1))/grasp/with_$(2).csv: $(folder_$(1))/grasp/map_$(2).pcd $(3)
	@exec $$(GRASPMAP) lookup $$^ --points-frame input -o $$@ --quiet \
	  --column '$(2)_score=score,$(2)_convex=convex,$(2)_graspable=graspable'
endef

# Argument: number of the scenario.
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
$(call grasp_lookup,$(1),calibrated,$(folder_$(1))/grasp/with_corrected.csv)
$(folder_$(1))/grasp/again.csv: $(grasp_mesh_$(1)) $(folder_$(1))/grasp/with_calibrated.csv
	@exec $$(GRASPMAP) grasp $$< --points $$(word 2,$$^) -o $$@ $$(TRIALS) $(grasp_flags_$(1)) --best-draws 0 --seed 2 \
	  --prefix again_ --quiet
$(folder_$(1))/grasp/table.csv: $(grasp_mesh_$(1)) $(folder_$(1))/grasp/$(or $(grasp_last_$(1)),again).csv
	@exec $$(GRASPMAP) grasp $$< --points $$(word 2,$$^) -o $$@ $$(TRIALS) $(grasp_flags_$(1)) \
	  --load 10 --more-loads 5,30 --quiet
$(call grasp_evaluation,$(1),10,graspable)
$(call grasp_evaluation,$(1),5,graspable_5)
$(call grasp_evaluation,$(1),30,graspable_30)
endef

# Arguments: number of the scenario, load, label.
define grasp_evaluation
$(folder_$(1))/grasp/evaluation_$(2)/accuracy.csv: $(folder_$(1))/grasp/table.csv
	@exec $$(GRASPMAP) evaluate $$< -o $$(@D) --label $(3) --score $(call commas,$(grasp_columns) $(grasp_more_$(1))) \
	  --cutoff 0.8 --bootstrap 1000 --title 'virtual field test at $(2) N: $(subst _, ,$(name_$(1)))' --quiet
results += $(folder_$(1))/grasp/evaluation_$(2)/accuracy.csv
endef

# Effect of scan errors: surface of a scan with noise and drift, in the frame of the truth.
grasp_last_4 := scanned
grasp_more_4 := scanned_hold_probability scanned_graspable
$(folder_4)/grasp/scan.db: $(folder_4)/site/mesh.ply
	@mkdir -p $(@D)
	@exec $(GRASPMAP) simulate scan $< --frames 60 --seed $(SEED) -o $@ --quiet
$(folder_4)/grasp/poses.tum: $(folder_4)/grasp/scan.db
	@exec $(GRASPMAP) refine $< -o $@ --quiet
$(folder_4)/grasp/scan.ply: $(folder_4)/grasp/scan.db $(folder_4)/grasp/poses.tum
	@exec $(GRASPMAP) fuse $< --poses $(word 2,$^) --frame ground-truth -o $@ --quiet
$(folder_4)/grasp/scanned.ply: $(folder_4)/grasp/scan.ply
	@exec $(GRASPMAP) mesh $< -o $@ --quiet
$(folder_4)/grasp/scanned.csv: $(folder_4)/grasp/scanned.ply $(folder_4)/grasp/again.csv
	@exec $(GRASPMAP) grasp $< --points $(word 2,$^) -o $@ $(TRIALS) --best-draws 0 \
	  --prefix scanned_ --max-distance 0.5 --quiet

# Surfaces of the author's clouds. The inclined board of holds is rotated to horizontal.
define grasp_real_mesh
$(folder_$(1))/mesh.ply: $(grasp_cloud_$(1))
	@mkdir -p $$(@D)
	@exec $$(GRASPMAP) mesh $$< -o $$@ $(grasp_mesh_flags_$(1)) --quiet
endef
ifneq ($(clouds),)
$(foreach n,5 6,$(eval $(call grasp_real_mesh,$(n))))
$(folder_7)/leaning.ply: $(clouds)/leaning_bouldering_holds.pcd
	@mkdir -p $(@D)
	@exec $(GRASPMAP) mesh $< -o $@ --quiet
$(folder_7)/mesh.ply: $(folder_7)/leaning.ply
	@exec $(GRASPMAP) crop $< -o $@ --center --quiet
$(folder_7)/terrain.pcd: $(folder_7)/mesh.ply
	@exec $(GRASPMAP) resample $< -o $@ --count 18401 --quiet
endif

# Scenario 4 with other parameters. Arguments: name, flags of grasp.
define grasp_sweep
$(OUT)/grasp_sweep/$(1)/accuracy.csv: $(grasp_mesh_4) $(folder_4)/grasp/again.csv
	@mkdir -p $(OUT)/grasp_sweep
	@$$(GRASPMAP) grasp $$< --points $$(word 2,$$^) -o $(OUT)/grasp_sweep/$(1).csv $$(TRIALS) \
	  --best-draws 0 --no-ensemble $(2) --quiet && \
	exec $$(GRASPMAP) evaluate $(OUT)/grasp_sweep/$(1).csv -o $$(@D) --label graspable \
	  --score $(call commas,$(grasp_score) nz) --bootstrap 1000 --title '$(1)' --quiet
results += $(OUT)/grasp_sweep/$(1)/accuracy.csv
endef

ifneq ($(filter grasp,$(STAGES)),)
$(foreach n,$(SCENARIOS) $(if $(clouds),5 6 7),$(eval $(call grasp_study,$(n))))
ifneq ($(filter 4,$(SCENARIOS)),)
$(eval $(call grasp_sweep,friction_0.25,--set gripper.engagement.friction=0.25))
$(eval $(call grasp_sweep,friction_0.6,--set gripper.engagement.friction=0.6))
$(eval $(call grasp_sweep,steeper_asperities,--set gripper.engagement.asperity_min_deg=30))
$(eval $(call grasp_sweep,flatter_asperities,--set gripper.engagement.asperity_max_deg=60))
$(eval $(call grasp_sweep,drag_2mm,--set gripper.engagement.drag_mm=2))
$(eval $(call grasp_sweep,closing_force_5,--set gripper.fingers.closing_force_n=5))
$(eval $(call grasp_sweep,closing_force_20,--set gripper.fingers.closing_force_n=20))
$(eval $(call grasp_sweep,four_fingers,--set gripper.fingers.count=4))
$(eval $(call grasp_sweep,curl_40,--set gripper.fingers.curl_deg=40))
$(eval $(call grasp_sweep,adhesion,--law adhesion))
$(eval $(call grasp_sweep,drives_give_way,--set gripper.fingers.holds_when_closed=false))
endif
endif
