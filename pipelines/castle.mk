# Map from a third-party RealSense sequence: 30 frames of a hand-held SR300 around a model castle, from
# ViSP's test data, with planes measured on the castle.
#
#   sudo apt install visp-images-data netpbm
#   make -f pipelines/castle.mk OUT=folder -j2
#
# The scan has separate cameras for depth and color, no poses, and the noise of a short-range sensor.
# planes.txt contains the distances of the measured planes to the mesh; the camera did not see all
# planes. The other results are those of scan.mk.

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
CASTEL ?= /usr/share/visp-images-data/ViSP-images/mbt-depth/castel
noise := --axial-noise 0.0005 --range-noise 0.002

ifeq ($(OUT),)
  $(error OUT is not set; set the folder for the results, e.g. OUT=results)
endif
ifeq ($(wildcard $(CASTEL)/chateau.cao),)
  $(error $(CASTEL) does not contain the castle sequence: apt install visp-images-data)
endif

.DELETE_ON_ERROR:
.PHONY: all chain
all: chain
	@exec $(MAKE) --no-print-directory -f $(here)castle.mk $(OUT)/planes.txt

# castle.py writes this file last.
$(OUT)/map_from_planes.txt: $(here)castle.py
	@mkdir -p $(OUT)
	@$(here)castle.py $(CASTEL) $(OUT)

chain: $(OUT)/map_from_planes.txt
	@$(MAKE) --no-print-directory -f $(here)scan.mk SCAN=$(OUT)/scan OUT=$(OUT) POSES=refined \
	  REFINE="$(noise) --frame-time 0.067" FUSE="--voxel-size 0.001 --max-depth 0.6 $(noise)" \
	  MESH="--cell-size 0.001" CROP="--up=-0.39,0,0.92" RESAMPLE="--radius 0.0012" \
	  SCORE="--gripper hubrobo --voxel-size 0.001" TITLE="castle"

$(OUT)/planes.txt: $(OUT)/mesh.ply $(OUT)/map_from_planes.txt
	@exec $(GRASPMAP) compare $(OUT)/planes.obj $(OUT)/mesh.ply --transform $(OUT)/map_from_planes.txt \
	  --icp --icp-max-distance 0.01 --within 0.002 --samples-per-m2 1000000 > $@.partial
	@cat $@.partial
	@mv $@.partial $@
