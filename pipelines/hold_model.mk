# Fits the section hold_model of a gripper file, which method calibrated needs: simulated sites, the
# virtual field test at places spread evenly over them, what a closing gripper would meet there on
# the voxel map, and a logistic regression of one on the other.
#
#   make -f pipelines/hold_model.mk OUT=folder [GRIPPER=scar-e] [SEEDS="201 202"] [LOAD=10] -j2
#
# OUT/hold_model.yaml is the section, OUT/fit/summary.md how well it predicts the places that it was
# fitted to. For other places: OUT/check_KIND_SEED/summary.md of the seeds in CHECK_SEEDS, which the
# fit does not see.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
GRIPPER ?= scar-e
SEEDS ?= 201 202
CHECK_SEEDS ?= 301
KINDS ?= rocks slopes_and_bumps bouldering_wall primitive_shapes
PLACES ?= 1500
TRIALS ?= --trials 24 --draws 8
LOAD ?= 10
VOXEL ?= 0.01
EDGE ?= 0.008
COUNT ?= 73000

ifeq ($(OUT),)
  $(error OUT is not set: the folder of the results, e.g. OUT=hold_model)
endif

include $(here)one_run.mk
ifdef is_alone

# Away from the border, where the gripper would be over nothing.
box_rocks := -1.3,-1.3,1.3,1.3
box_slopes_and_bumps := -2.5,-1.9,2.5,1.9
box_bouldering_wall := -1.3,-1.3,1.3,1.3
box_primitive_shapes := -0.8,-0.8,0.8,0.8
crop_rocks := --level none --box=-1.5,-1.5,1.5,1.5
crop_slopes_and_bumps := --level none --box=-2.7,-2.1,2.7,2.1
crop_bouldering_wall := --up=0,-1,0 --center --box=-1.5,-1.5,1.5,1.5

# Terms are measured with any weights.
weights := $(foreach key,intercept contact bearing rise depth,--set gripper.hold_model.$(key)=0) \
  --set gripper.hold_model.load_n=$(LOAD)
terms := closing_contact closing_bearing closing_rise closing_depth
empty :=
space := $(empty) $(empty)
comma := ,

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all
all: $(OUT)/hold_model.yaml

# Kind, seed.
define site
ifeq ($(1),primitive_shapes)
$(OUT)/$(1)_$(2)/mesh.ply:
	@mkdir -p $$(@D)
	@exec $$(GRASPMAP) simulate scene --mesh -o $$@ --quiet
else
$(OUT)/$(1)_$(2)/site/mesh.ply:
	@mkdir -p $$(@D)
	@exec $$(GRASPMAP) simulate site --site $(1) --seed $(2) --edge-length $(EDGE) \
	  -o $(OUT)/$(1)_$(2)/site --quiet --force
$(OUT)/$(1)_$(2)/mesh.ply: $(OUT)/$(1)_$(2)/site/mesh.ply
	@exec $$(GRASPMAP) crop $$< -o $$@ $(crop_$(1)) --quiet
endif
$(OUT)/$(1)_$(2)/inner.ply: $(OUT)/$(1)_$(2)/mesh.ply
	@exec $$(GRASPMAP) crop $$< -o $$@ --level none --box=$(box_$(1)) --quiet
$(OUT)/$(1)_$(2)/places.csv: $(OUT)/$(1)_$(2)/inner.ply
	@exec $$(GRASPMAP) resample $$< -o $$@ --count $(PLACES) --seed $(2) --quiet
$(OUT)/$(1)_$(2)/terrain.pcd: $(OUT)/$(1)_$(2)/mesh.ply
	@exec $$(GRASPMAP) resample $$< -o $$@ --count $(COUNT) --seed $(2) --quiet
$(OUT)/$(1)_$(2)/map.pcd: $(OUT)/$(1)_$(2)/terrain.pcd
	@exec $$(GRASPMAP) score $$< -o $$@ --method calibrated --gripper $(GRIPPER) \
	  --voxel-size $(VOXEL) --curvature-radius 0 $$(weights) --quiet
$(OUT)/$(1)_$(2)/verdicts.csv: $(OUT)/$(1)_$(2)/mesh.ply $(OUT)/$(1)_$(2)/places.csv
	@exec $$(GRASPMAP) grasp $$< --points $$(word 2,$$^) -o $$@ --gripper $(GRIPPER) $(TRIALS) \
	  --best-draws 0 --load $(LOAD) --quiet
$(OUT)/$(1)_$(2)/table.csv: $(OUT)/$(1)_$(2)/map.pcd $(OUT)/$(1)_$(2)/verdicts.csv
	@exec $$(GRASPMAP) lookup $$^ -o $$@ --points-frame input --quiet \
	  --column $(subst $(space),$(comma),$(foreach term,$(terms),$(term)=$(term)))
endef
$(foreach kind,$(KINDS),$(foreach seed,$(SEEDS) $(CHECK_SEEDS),$(eval $(call site,$(kind),$(seed)))))

tables := $(foreach kind,$(KINDS),$(foreach seed,$(SEEDS),$(OUT)/$(kind)_$(seed)/table.csv))

$(OUT)/hold_model.yaml: $(tables)
	@exec $(GRASPMAP) evaluate $^ -o $(OUT)/fit --label graspable --score nz,closing_contact,closing_bearing \
	  --hold-model $@ --load $(LOAD) --bootstrap 0 --title 'fitted places' --force

# The gripper's file with the new section.
file := $(firstword $(wildcard $(here)../data/grippers/$(GRIPPER).yaml) $(GRIPPER))
$(OUT)/gripper.yaml: $(OUT)/hold_model.yaml
	@sed '/^hold_model:/,$$d' $(file) > $@ && cat $< >> $@

# Kind, seed.
define check
$(OUT)/$(1)_$(2)/probability.pcd: $(OUT)/$(1)_$(2)/terrain.pcd $(OUT)/gripper.yaml
	@exec $$(GRASPMAP) score $$< -o $$@ --method calibrated --gripper $(OUT)/gripper.yaml \
	  --voxel-size $(VOXEL) --curvature-radius 0 --quiet
$(OUT)/$(1)_$(2)/corrected.pcd: $(OUT)/$(1)_$(2)/terrain.pcd
	@exec $$(GRASPMAP) score $$< -o $$@ --method corrected --gripper $(GRIPPER) \
	  --voxel-size $(VOXEL) --quiet
$(OUT)/$(1)_$(2)/with_probability.csv: $(OUT)/$(1)_$(2)/probability.pcd $(OUT)/$(1)_$(2)/table.csv
	@exec $$(GRASPMAP) lookup $$^ -o $$@ --points-frame input --column probability=score --quiet
$(OUT)/$(1)_$(2)/checked.csv: $(OUT)/$(1)_$(2)/corrected.pcd $(OUT)/$(1)_$(2)/with_probability.csv
	@exec $$(GRASPMAP) lookup $$^ -o $$@ --points-frame input --column corrected=score --quiet
$(OUT)/check_$(1)_$(2)/summary.md: $(OUT)/$(1)_$(2)/checked.csv
	@exec $$(GRASPMAP) evaluate $$< -o $$(@D) --label graspable --score probability,corrected,nz \
	  --cutoff 0.5 --title '$(subst _, ,$(1)) $(2), $(GRIPPER), $(LOAD) N' --force
all: $(OUT)/check_$(1)_$(2)/summary.md
endef
$(foreach kind,$(KINDS),$(foreach seed,$(CHECK_SEEDS),$(eval $(call check,$(kind),$(seed)))))
endif
