"""What needs no service."""

import io

import pydantic
import pytest

import precut
from precut import Answer, models
from precut._events import Reader
from precut._progress import Bar


def test_units_and_ranges_stand_in_names_and_docstrings():
    feed = models.Cut.model_fields["feed_mm_per_rev"]
    models.Cut.model_rebuild()
    assert "[mm/rev, 0.0001 to 20]" in models.Cut.model_json_schema()["properties"]["feed_mm_per_rev"]["description"]
    assert feed.is_required()


def test_a_model_refuses_what_a_field_alone_shows():
    with pytest.raises(pydantic.ValidationError, match="feed_mm_per_rev"):
        models.Cut(feed_mm_per_rev=50, speed_m_per_min=100)
    with pytest.raises(pydantic.ValidationError, match="feeed"):
        models.Cut(feed_mm_per_rev=0.5, feeed=1)


def test_only_what_was_said_is_sent():
    support = models.SupportCentre(z_mm=0, tangential_compliance_um_per_n=None)
    assert support.as_sent() == {"kind": "centre", "z_mm": 0.0}


def test_a_job_says_its_calculator():
    client = precut.Client()
    with pytest.raises(TypeError, match="does not say which calculator"):
        client.solve({"shaft": {}})
    with pytest.raises(TypeError, match="is a job of studies, not of diagnosis"):
        client.solve("diagnosis", models.StudyJob(calculator="x", job={}, vary=[{"pointer": "/a", "values": [1]}]))


def test_lines_become_events():
    reader = Reader()
    lines = [":", "", "event: news", "data: {}", "", "event: progress", "id: 7", 'data: {"progress":', "data: 0.5}", ""]
    (event,) = filter(None, map(reader.line, lines))
    assert (event.kind, event.id, event.data.progress) == ("progress", "7", 0.5)


def test_the_bar_is_one_line():
    out = io.StringIO()
    bar = Bar("ring-roundness", out)
    for done in (0.25, 1.0):
        bar(precut.Event("progress", "1", models.JobProgress(progress=done, stage="map", remaining_ms=1500.0)))
    first, second = out.getvalue().split("\r")[1:]
    assert first.startswith("ring-roundness [########......") and " 25%, map, 2 s left" in first
    assert len(second) == len(first) and "100%" in second


def test_what_a_newer_service_adds_is_kept():
    zone = {"name": "whole", "value": 1.0, "unit": "mm", "news": 7}
    with pytest.raises(pydantic.ValidationError):
        models.NamedValue(**zone)
    raw = {"calculator": "x", "key": "b3:0", "input": {}, "result": zone}
    assert Answer(raw, precut.Client(), models.NamedValue).result.model_extra == {"news": 7}
