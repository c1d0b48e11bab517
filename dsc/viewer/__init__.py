"""Runs in the browser: records in, a page out (see PROTOCOL.md); needs the extra `viewer`."""
