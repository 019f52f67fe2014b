# Map of a large terrain on a Slurm cluster: the tasks of a job array compute shares of the tiles in one
# tile store, then the tiles are merged.
#
#   make -f pipelines/slurm/tiles.mk TERRAIN=terrain OUT=folder SHARES=100 [SCENARIO=NAME|FILE]
#        [SCORE="..."] [SBATCH="--mem=2G --time=1:00:00"] [map]
#   make -f pipelines/slurm/tiles.mk TERRAIN=... OUT=... MESH=mesh.ply [GRASP="..."] held [held_map]
#   make -f pipelines/slurm/tiles.mk TERRAIN=... OUT=... SURFACE="--cell-size 0.01" mesh
#   make -f pipelines/slurm/tiles.mk SCAN=scan.db [POSES=poses.tum] OUT=... [FUSE="..."] cloud
#   make -f pipelines/slurm/tiles.mk MESH=folder SCAN=scan.db [POSES=poses.tum] OUT=... [TEXTURE="..."] model
#
# TERRAIN is a cloud or a folder of clouds. Goals:
#
#   tiles (default)  $(OUT)/map.tiles, which lookup, render, info and convert read
#   map              $(OUT)/map.pcd, merged from map.tiles
#   held             $(OUT)/held.tiles: the gripper tested at every voxel of the map on MESH, which is in
#                    the frame of TERRAIN
#   held_map         $(OUT)/held.pcd, merged from held.tiles
#   mesh             $(OUT)/mesh, the surface of TERRAIN (a cloud with normals) as a folder of tiles;
#                    SURFACE are flags of graspmap mesh and include --cell-size
#   cloud            $(OUT)/cloud, the fused depth images of SCAN as a folder of tiles, and
#                    $(OUT)/fused_poses.tum, the poses that fuse used
#   model            $(OUT)/model, the tiles of MESH textured with the photographs of SCAN
#
# All nodes must have the same paths to these files and to graspmap. SBATCH are further flags of sbatch,
# for example --cpus-per-task, or --array=1-100%10 to run ten tasks at a time. A second run does nothing.
# After a failed run, the next run computes the missing tiles. Logs: $(OUT)/logs, $(OUT)/held_logs,
# $(OUT)/mesh_logs and so on.

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

one_word = $(if $(word 2,$($(1))),$(error $(1) contains a space, which make cannot handle: $($(1))))
$(foreach name,TERRAIN OUT SCENARIO SHARES MESH SCAN POSES,$(call one_word,$(name)))
ifeq ($(filter cloud model,$(MAKECMDGOALS)),)
  ifeq ($(wildcard $(TERRAIN)),)
    $(error TERRAIN is '$(TERRAIN)': it must be a cloud or a folder of clouds)
  endif
else
  $(foreach name,SCAN $(if $(filter model,$(MAKECMDGOALS)),MESH),$(if $(wildcard $($(name))),,$(error $(name) is '$($(name))': no such file)))
endif
ifeq ($(OUT),)
  $(error OUT is not set; set the folder for the results, e.g. OUT=results)
endif
ifneq ($(shell test '$(SHARES)' -ge 1 2>/dev/null && echo yes),yes)
  $(error SHARES is '$(SHARES)': must be an integer >= 1)
endif

include $(here)../one_run.mk
ifdef is_alone

# Tasks run in the folder of their submission. Paths are made absolute nevertheless.
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

# Stamp file of the inputs and parameters of the tiles, rewritten only if they change. Tiles of another
# terrain or of other parameters are then deleted.
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

# $(call in_shares,LOGS,STORE,COMMAND WORDS). sbatch --wait ends after the last task and returns the
# largest exit code. A requeued task has not ended.
define in_shares
@GRASPMAP=$(program) TRIES=$(TRIES) sbatch --wait --export=ALL --array=1-$(SHARES) \
  --output=$(1)/%a.log $(SBATCH) $(here)tile_share.sbatch $(SHARES) $(2) $(3) --quiet || \
  { echo "tiles.mk: tasks failed; see $(1), then run make again to compute the missing tiles" >&2; exit 1; }
@test -e $@ || $(program) info $(2) >$(1)/info.log
@touch -c $@
endef

$(store)/index.json: $(TERRAIN) $(OUT)/scored_with | $(logs)
	$(call in_shares,$(logs),$(store),score $(terrain) $(score_flags))

$(held)/index.json: $(MESH) $(store)/index.json $(OUT)/grasped_with | $(held_logs)
	$(if $(MESH),,$(error MESH is not set; set the mesh on which the gripper is tested, e.g. MESH=mesh.ply))
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
