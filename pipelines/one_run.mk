# One make at a time works in the folder $(OUT). A make file includes this before its rules, which
# hold only once it is alone:
#
#   include $(here)one_run.mk
#   ifdef is_alone
#   ... rules
#   endif
#
# The first make takes a lock, $(OUT)/.lock, and becomes a second one of the same goals that has the
# rules. The system gives the lock back when that one and all its commands have ended, however they
# end: the file that stays behind means nothing by itself.
#
# Recipes `exec` what they run: make hands SIGTERM to its children, but a shell in between would not
# hand it on.

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
