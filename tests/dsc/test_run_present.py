"""What a run needs to go on, written bit by bit, is at every moment all of it."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing

from dsc_charts import PROPERTY
from hypothesis import given, settings
from hypothesis import strategies as st
from random_charts import happenings, libraries
from test_engine_properties import Played

from dsc.engine.state import MachineState
from dsc.sequencer.run_forms import Shortener, frame_form
from dsc.sequencer.run_present import Present
from dsc.sequencer.run_tables import TABLES

EVERY_KIND = st.one_of(libraries(depth=2), libraries(scxml=True, depth=2))


@settings(PROPERTY, max_examples=40)
@given(EVERY_KIND, happenings())
def test_the_frames_that_have_changed_are_enough_to_have_all_of_them(plots, happened):
    forms, played = {}, Played(*plots)
    present = Present(Shortener(forms.__setitem__))
    with closing(sqlite3.connect(":memory:")) as connection:
        for statement in TABLES:
            connection.execute(statement)
        for _ in played.steps(happened):
            state = played.machine.state
            present.frames(connection, state.root)
            texts = dict(connection.execute("SELECT serial, frame FROM frames"))
            assert len(texts) == (len(list(state.root.frames())) if state.root else 0)
            if state.root is not None:
                root = frame_form(state.root.serial, texts, lambda digest: json.loads(forms[digest]))
                form = {"root": root, "serials": state.serials, "finished": state.finished}
                assert MachineState.from_json(form, played.library) == state
