"""A session in the browser: begun from a folder of photographs, or looked at in its output folder; and put right.

What is read, measured, corrected, written and drawn are plain functions, without a browser. A class `*View` is what
stands in the 3-D view; rows and views only call these.
"""
