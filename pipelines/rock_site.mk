# Simulation of scenario 4 of the thesis: a rock site, its scan by a hand-held Kinect v2, and the stages
# of scan.mk (cloud, surface, the 3 x 3 m site, texture, samples, map). Measures the distances of cloud
# and site to the true mesh. Needs no data. FIELD_TEST are flags of `graspmap grasp` on the true mesh.
#
#   make -f pipelines/rock_site.mk OUT=folder [SEED=1] [FRAMES=60] [SITE=rocks] [EDGE=0.008] -j2

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
OUT ?= rock_site
SEED ?= 1
FRAMES ?= 60
SITE ?= rocks
EDGE ?= 0.008
POSES ?= refined
CROP ?= --size 3x3
SCENARIO ?= artificial_rocks_prescan
METHOD ?= calibrated
SHARES ?= 4
FIELD_TEST ?=

include $(here)one_run.mk
ifdef is_alone

site_flags := --site $(SITE) --seed $(SEED) --edge-length $(EDGE)
scan_flags := --seed $(SEED) --frames $(FRAMES)

.DELETE_ON_ERROR:
.PHONY: all map FORCE
all: $(OUT)/site.png map

$(OUT):
	@mkdir -p $@

# Stamp file of the variables that site and scan depend on, rewritten only if they change.
export simulated_with := $(site_flags) $(scan_flags)
$(OUT)/simulated_with: FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

$(OUT)/site/mesh.ply $(OUT)/site/field_points.csv $(OUT)/site/site.yaml &: $(OUT)/simulated_with
	@exec $(GRASPMAP) simulate site $(site_flags) -o $(OUT)/site

export tested_with := $(FIELD_TEST)
$(OUT)/tested_with: FORCE | $(OUT)
	@printf '%s\n' "$${$(@F)}" | cmp -s - $@ || printf '%s\n' "$${$(@F)}" > $@

$(OUT)/site.png: $(OUT)/site/mesh.ply
	@exec $(GRASPMAP) render $< -o $@ --view oblique --color own --title 'simulated site' --quiet

$(OUT)/scan.db: $(OUT)/site/mesh.ply
	@exec $(GRASPMAP) simulate scan $< $(scan_flags) -o $@

# Virtual field test: simulated grasps on the true mesh.
$(OUT)/field_test.csv: $(OUT)/site/mesh.ply $(OUT)/site/field_points.csv $(OUT)/tested_with
	@exec $(GRASPMAP) grasp $< --points $(word 2,$^) $(FIELD_TEST) -o $@

map: $(OUT)/scan.db $(OUT)/field_test.csv
	@exec $(MAKE) --no-print-directory -f $(here)scan.mk SCAN=$< OUT=$(OUT)/scan POSES=$(POSES) \
	  CROP="$(CROP)" \
	  TRUTH=$(OUT)/site/mesh.ply POINTS=$(OUT)/field_test.csv SCENARIO=$(SCENARIO) \
	  METHOD=$(METHOD) SHARES=$(SHARES) GRASPMAP=$(GRASPMAP) TITLE='simulated scan'
endif
