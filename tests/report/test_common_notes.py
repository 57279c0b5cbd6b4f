"""A note that all joints of a robot share is told once."""

from dataclasses import replace
from html import unescape

from drake_tc.cli.close_loop_summary import print_summary
from drake_tc.diagnosis.result.common_notes import common_notes
from drake_tc.diagnosis.timing_notes import AllRecordedLate, HeldEffort, RecordedLate
from drake_tc.report.html import render
from drake_tc.report.report_json import result_json
from drake_tc.report.sentences.notes import note_sentence, note_sentences


def test_a_note_of_all_joints_is_told_once_in_console_json_and_page(joint, result, capsys, tmp_path):
    late, own = RecordedLate("current", 0.012), HeldEffort("current", 0.002)
    told = replace(joint, notes=(late, own), load_notes=(late,))
    joints, notes = common_notes({"hip": replace(told, joint="hip"), "knee": told})
    whole = replace(result, joints=joints, notes=notes)
    (sentence,) = note_sentences(notes)
    assert "all joints seem to act 12 ms before they are recorded" in sentence
    print_summary(whole, tmp_path)
    console, page = (" ".join(text.split()) for text in (capsys.readouterr().out, unescape(render(whole))))
    assert console.count("12 ms before") == page.count("12 ms before") == 1
    document = result_json(whole)
    assert document["notes"] == [sentence]
    assert [entry["notes"] for entry in document["joints"].values()] == [[note_sentence(own)]] * 2


def test_a_late_effort_of_some_joints_or_by_different_times_stays_with_them(joint):
    late = replace(joint, notes=(RecordedLate("current", 0.012),))
    other = replace(joint, notes=(RecordedLate("current", 0.02),))
    for joints in ({"hip": late, "knee": joint}, {"hip": late, "knee": other}, {"knee": late}):
        assert common_notes(joints) == (joints, ())
    mixed = replace(joint, drive="torque", notes=(RecordedLate("torque", 0.012),))
    assert common_notes({"hip": late, "knee": mixed})[1] == (AllRecordedLate(None, 0.012),)
