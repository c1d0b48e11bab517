"""`dsc kb`: a world model on the command line; commands import their modules on use, so that help stays light."""

from __future__ import annotations

from knowledge_base.cli.app import app as app
from knowledge_base.cli.inputs import readers as readers
