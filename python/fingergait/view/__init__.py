"""The live page: runs, a bench to play with, and recorded logs in the browser. Needs the extra `fingergait[view]`."""
