# A large terrain's map by a Slurm cluster: an array of tasks makes shares of its tiles in one store,
# then the tiles are merged.
#
#   make -f pipelines/slurm/tiles.mk TERRAIN=terrain OUT=folder SHARES=100 [SCENARIO=NAME|FILE]
#        [SCORE="..."] [SBATCH="--mem=2G --time=1:00:00"] [map]
#   make -f pipelines/slurm/tiles.mk TERRAIN=... OUT=... MESH=mesh.ply [GRASP="..."] held [held_map]
#   make -f pipelines/slurm/tiles.mk TERRAIN=... OUT=... SURFACE="--cell-size 0.01" mesh
#   make -f pipelines/slurm/tiles.mk SCAN=scan.db [POSES=poses.tum] OUT=... [FUSE="..."] cloud
#   make -f pipelines/slurm/tiles.mk MESH=folder SCAN=scan.db [POSES=poses.tum] OUT=... [TEXTURE="..."] model
#
# TERRAIN is a cloud or a folder of clouds. The default goal makes $(OUT)/map.tiles, which lookup,
# render, info and convert read; `map` merges it to $(OUT)/map.pcd as well. `held` tests the gripper
# at every voxel of the map on MESH, in the frame of TERRAIN: $(OUT)/held.tiles, merged by `held_map`
# to $(OUT)/held.pcd. `mesh` makes the surface of TERRAIN, a cloud with normals, in a folder of pieces,
# $(OUT)/mesh; SURFACE holds the flags of graspmap mesh, among them --cell-size. `cloud` fuses the depth
# images of SCAN to a folder of pieces, $(OUT)/cloud, and writes the poses that it was fused by,
# $(OUT)/fused_poses.tum. `model` textures the pieces of MESH with the photographs of SCAN,
# $(OUT)/model. All of these files and graspmap itself
# must be reached by the same path on all nodes. SBATCH holds further flags of sbatch, among them --cpus-per-task and --array=1-100%10 to run
# ten at a time. A second run does nothing; after a run that failed, the next makes what is missing.
# Logs: $(OUT)/logs, $(OUT)/held_logs, $(OUT)/mesh_logs and so on.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../../build/release/graspmap) graspmap)
SCENARIO ?= artificial_rocks_prescan
SHARES ?= 16
SCORE ?=
MESH ?=
GRASP ?=
SURFACE ?=
SCAN ?=
POSES ?= optimized
TEXTURE ?=
FUSE ?=
SBATCH ?=
TRIES ?= 3

one_word = $(if $(word 2,$($(1))),$(error $(1) holds a space, which make cannot handle: $($(1))))
$(foreach name,TERRAIN OUT SCENARIO SHARES MESH SCAN POSES,$(call one_word,$(name)))
ifeq ($(filter cloud model,$(MAKECMDGOALS)),)
  ifeq ($(wildcard $(TERRAIN)),)
    $(error TERRAIN is '$(TERRAIN)': it must be a cloud or a folder of clouds)
  endif
else
  $(foreach name,SCAN $(if $(filter model,$(MAKECMDGOALS)),MESH),$(if $(wildcard $($(name))),,$(error $(name) is '$($(name))': there is no such file)))
endif
ifeq ($(OUT),)
  $(error OUT is not set: the folder of the results, e.g. OUT=results)
endif
ifneq ($(shell test '$(SHARES)' -ge 1 2>/dev/null && echo yes),yes)
  $(error SHARES is '$(SHARES)': it must be a whole number >= 1)
endif

include $(here)../one_run.mk
ifdef is_alone

# Tasks run in the folder of their submission; paths are made whole all the same.
program := $(shell command -v $(GRASPMAP))
terrain := $(abspath $(TERRAIN))
mesh := $(abspath $(MESH))
store := $(abspath $(OUT))/map.tiles
held := $(abspath $(OUT))/held.tiles
logs := $(abspath $(OUT))/logs
held_logs := $(abspath $(OUT))/held_logs
surface := $(abspath $(OUT))/mesh
mesh_logs := $(abspath $(OUT))/mesh_logs
cloud := $(abspath $(OUT))/cloud
cloud_logs := $(abspath $(OUT))/cloud_logs
model := $(abspath $(OUT))/model
model_logs := $(abspath $(OUT))/model_logs
score_flags := --config $(SCENARIO) $(SCORE)

.PHONY: tiles map held held_map cloud mesh model FORCE
tiles: $(store)/index.json
map: $(OUT)/map.pcd
held: $(held)/index.json
held_map: $(OUT)/held.pcd
mesh: $(surface)
cloud: $(cloud)
model: $(model)

$(OUT) $(logs) $(held_logs) $(cloud_logs) $(mesh_logs) $(model_logs):
	@mkdir -p $@

# A stamp of what the tiles depend on: written anew only if it changes, and then tiles of another
# terrain or other parameters go.
export scored_with := $(TERRAIN) $(score_flags)
$(OUT)/scored_with: FORCE | $(OUT)
	@printf '%s\n' "$$scored_with" | cmp -s - $@ || \
	  { rm -rf $(store) $(store).json && printf '%s\n' "$$scored_with" > $@; }

export grasped_with := $(scored_with) $(MESH) $(GRASP)
$(OUT)/grasped_with: FORCE | $(OUT)
	@printf '%s\n' "$$grasped_with" | cmp -s - $@ || \
	  { rm -rf $(held) $(held).json && printf '%s\n' "$$grasped_with" > $@; }

export meshed_with := $(TERRAIN) $(SURFACE)
$(OUT)/meshed_with: FORCE | $(OUT)
	@printf '%s\n' "$$meshed_with" | cmp -s - $@ || \
	  { rm -rf $(surface) $(surface).json $(surface).progress && printf '%s\n' "$$meshed_with" > $@; }

export fused_with := $(SCAN) $(POSES) $(FUSE)
$(OUT)/fused_with: FORCE | $(OUT)
	@printf '%s\n' "$$fused_with" | cmp -s - $@ || \
	  { rm -rf $(cloud) $(cloud).json $(cloud).progress && printf '%s\n' "$$fused_with" > $@; }

export textured_with := $(MESH) $(SCAN) $(POSES) $(TEXTURE)
$(OUT)/textured_with: FORCE | $(OUT)
	@printf '%s\n' "$$textured_with" | cmp -s - $@ || \
	  { rm -rf $(model) $(model).json $(model).progress && printf '%s\n' "$$textured_with" > $@; }

# $(call in_shares,LOGS,STORE,COMMAND WORDS). sbatch --wait ends when the last task has, with the
# largest of their exit codes. A task that has been put back into the queue is not at its end.
define in_shares
@GRASPMAP=$(program) TRIES=$(TRIES) sbatch --wait --export=ALL --array=1-$(SHARES) \
  --output=$(1)/%a.log $(SBATCH) $(here)tile_share.sbatch $(SHARES) $(2) $(3) --quiet || \
  { echo "tiles.mk: tasks failed; $(1) says why, and make again makes what is missing" >&2; exit 1; }
@test -e $@ || $(program) info $(2) >$(1)/info.log
@touch -c $@
endef

$(store)/index.json: $(TERRAIN) $(OUT)/scored_with | $(logs)
	$(call in_shares,$(logs),$(store),score $(terrain) $(score_flags))

$(held)/index.json: $(MESH) $(store)/index.json $(OUT)/grasped_with | $(held_logs)
	$(if $(MESH),,$(error MESH is not set: the mesh on which the gripper is tested))
	$(call in_shares,$(held_logs),$(held),grasp $(mesh) --map $(store) $(GRASP))

$(surface): $(TERRAIN) $(OUT)/meshed_with | $(mesh_logs)
	$(call in_shares,$(mesh_logs),$@,mesh $(terrain) $(SURFACE))

poses := $(or $(abspath $(wildcard $(POSES))),$(POSES))

$(cloud): $(SCAN) $(wildcard $(POSES)) $(OUT)/fused_with | $(cloud_logs)
	$(call in_shares,$(cloud_logs),$@,fuse $(abspath $(SCAN)) --poses $(poses) \
	  --corrected-poses $(abspath $(OUT))/fused_poses.tum $(FUSE))

$(model): $(MESH) $(SCAN) $(wildcard $(POSES)) $(OUT)/textured_with | $(model_logs)
	$(call in_shares,$(model_logs),$@,texture $(mesh) --scan $(abspath $(SCAN)) \
	  --poses $(poses) $(TEXTURE))

$(OUT)/map.pcd: $(store)/index.json
	@exec $(program) convert $(store) -o $@

$(OUT)/held.pcd: $(held)/index.json
	@exec $(program) convert $(held) -o $@
endif
