"""Viewer of runs in the browser, from records to a page (see PROTOCOL.md); needs the extra `viewer`."""
