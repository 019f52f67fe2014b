# Demonstration without data: rock_site.mk (from a simulated scan's database to the map),
# primitive_shapes.mk (shapes of known graspability), and one report of both.
#
#   make -f pipelines/demo.mk OUT=folder -j2

here := $(dir $(lastword $(MAKEFILE_LIST)))
GRASPMAP ?= $(firstword $(wildcard $(here)../build/release/graspmap) graspmap)
OUT ?= demo

include $(here)one_run.mk
ifdef is_alone

page := $(OUT)/report.html

.DELETE_ON_ERROR:
.PHONY: all rock_site primitive_shapes
# The report is rewritten only if a result is newer.
all: rock_site primitive_shapes
	@test -f $(page) && test -z "$$(find $(OUT) -type f -newer $(page) ! -name 'report.html*' \
	    ! -name .lock -print -quit)" || \
	  exec $(GRASPMAP) report $(OUT) --title "graspmap: the demo" --force -o $(page)

rock_site primitive_shapes:
	@exec $(MAKE) --no-print-directory -f $(here)$@.mk OUT=$(OUT)/$@ GRASPMAP=$(GRASPMAP)
endif
