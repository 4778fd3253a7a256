"""A session's output folder looked at in the browser: frames, balls, lights, scan, twin, warnings; and put right.

What is read, measured, corrected, written and drawn are plain functions, without a browser. A file `*_panel` is one
tab, a file `*_view` what stands in the 3-D view; both only call these.
"""
