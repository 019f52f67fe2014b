# Lock that allows only one make at a time in the folder $(OUT). A make file includes this file before its
# rules, which are defined only if the make holds the lock:
#
#   include $(here)one_run.mk
#   ifdef is_alone
#   ... rules
#   endif
#
# The first make locks $(OUT)/.lock and executes a second make with the same goals and the rules. The
# operating system releases the lock when the second make and all its commands have ended, for any
# reason. A leftover lock file has no effect.
#
# Recipes start programs with `exec`, because make sends SIGTERM to its children, but a shell between
# them would not forward it.

ifeq ($(folder_of_this_run),$(abspath $(OUT)))
is_alone := yes
else
.PHONY: one_run $(MAKECMDGOALS)
one_run:
	@mkdir -p $(OUT) && { flock --nonblock $(OUT)/.lock true || \
	  { echo '$(OUT): another make works in this folder' >&2; exit 1; }; } && \
	  exec flock --nonblock --no-fork $(OUT)/.lock $(MAKE) --no-print-directory \
	    -f $(firstword $(MAKEFILE_LIST)) $(MAKECMDGOALS) 'folder_of_this_run=$(abspath $(OUT))'
$(MAKECMDGOALS): one_run
endif
