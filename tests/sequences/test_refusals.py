"""What is refused of a sequence, and what the sentence must name: one row for each rule."""

import json

import pytest
from small_sequences import META, OWN_HEADER, SEQINFO, complaint_of

#: What becomes of a file (a text, or None if it is removed), how the sequence is opened, and what
#: the refusal must name.
ROWS = [
    # A clip of this project; the first line of boxes is right.
    *(
        ("own", {"gt.csv": f"{OWN_HEADER}0,2,1,2,3,4,0\n{line}\n"}, {}, ["line 3 of", named])
        for line, named in (
            ("1,2,3", "3 columns"),
            ("1,2,a,2,3,4,0", "x is 'a'"),
            ("1.5,2,3,2,3,4,0", "frame is '1.5'"),
            ("1,2,3,2,-1,4,0", "w is '-1'"),
            ("1,2,3,2,3,4,5", "occ is '5'"),
            ("0,2,3,2,3,4,0", "line 2"),
        )
    ),
    ("own", {"gt.csv": OWN_HEADER + "3,2,1,2,3,4,0\n"}, {}, ["frame 3", "3 frames"]),
    ("own", {"frames/0001.png": None}, {}, ["0001.png"]),
    ("own", {"meta.json": None}, {}, ["meta.json"]),
    ("own", {"meta.json": "{"}, {}, ["meta.json"]),
    *(
        ("own", {"meta.json": json.dumps(META | change)}, {}, ["meta.json", *named])
        for change, *named in (
            ({"n_frames": None}, "n_frames"),
            ({"n_frames": 2.5}, "n_frames"),
            ({"fps": 0}, "fps"),
            ({"width": 13}, "13 x 8", "12 x 8"),
            ({"frames": "%s.png"}, "frames"),
        )
    ),
    # MOTChallenge
    ("mot", {"img1/000003.png": None}, {}, ["img1/3"]),
    ("mot", {"gt/gt.txt": None}, {}, ["gt/gt.txt"]),
    ("mot", {"gt/gt.txt": None, "seqinfo.ini": None}, {}, ["seqinfo.ini"]),
    *(
        ("mot", {"seqinfo.ini": SEQINFO.replace(old, new)}, {}, named)
        for old, new, *named in (
            ("[Sequence]", "[Other]", "[Sequence]"),
            ("seqLength=8\n", "", "seqLength"),
            ("frameRate=12.5", "frameRate=0", "frameRate"),
            ("imDir=img1", "imDir=elsewhere", "elsewhere"),
            ("imWidth=120", "imWidth=121", "121 x 100", "120 x 100"),
        )
    ),
    *(
        ("mot", {}, options, named)
        for options, *named in (
            ({"ids": [5]}, "[5]", "4, 9"),
            ({"ids": [4, 4]}, "[4, 4]"),
            ({"ids": []}, "[]"),
            ({"start_frame": 8}, "start_frame", "7"),
            ({"start_frame": -1}, "start_frame"),
            ({"start_frame": 6, "num_frames": 3}, "num_frames", "2"),
            ({"num_frames": 0}, "num_frames"),
            ({"parameters": {"noise": 3}}, "noise"),
        )
    ),
    # OTB
    *(
        ("otb", {"groundtruth_rect.txt": f"6,7,20,24\n{line}\n"}, {}, ["line 2 of", named])
        for line, named in (
            ("1,2,3", "3 columns"),
            ("1,2,nan,4", "'nan'"),
            ("1,2,-3,4", "negative size"),
        )
    ),
    ("otb", {"groundtruth_rect.txt": "6,7,20,24\n" * 9}, {}, ["9 lines"]),
    ("otb", {"groundtruth_rect.txt": "0.1,0.2,0.3,0.4\n" * 8}, {}, ["multiply"]),
    ("otb", {"groundtruth_rect.txt": None}, {}, ["groundtruth_rect.txt"]),
    ("otb", {"groundtruth_rect.txt": None, "groundtruth_rect.2.txt": "0,0,0,0\n"}, {}, ["no box"]),
    ("otb", {"img/0001.jpg": ""}, {}, ["0001.jpg"]),
]


@pytest.mark.parametrize(("kind", "files", "options", "named"), ROWS)
def test_a_wrong_sequence_is_refused(request, kind, files, options, named):
    folder = request.getfixturevalue(f"{kind}_folder")
    for name, text in files.items():
        (folder / name).unlink(missing_ok=True)
        if text is not None:
            (folder / name).write_text(text)
    message = complaint_of(folder, **options)
    for words in named:
        assert words in message


@pytest.mark.parametrize("options", [{"num_frames": 3}, {"ids": [1]}])
def test_what_chooses_from_recordings_is_refused_for_drawn_scenes(options):
    message = complaint_of("distracter", **options)
    assert "distracter" in message
    assert next(iter(options)) in message


def test_unknown_folders_are_answered_with_the_formats(tmp_path):
    message = complaint_of(tmp_path)
    assert all(name in message for name in ("meta.json", "MOTChallenge", "OTB", str(tmp_path)))
    (tmp_path / "video.mp4").write_bytes(b"")
    for place in (tmp_path / "nowhere", "folder/nowhere", tmp_path / "video.mp4"):
        assert f"{place}" in complaint_of(place)
