"""The numbers that the notebooks' prose quotes, and where a cell prints them.

Notebook -> what the prose says -> a pattern of what is printed, any space as one blank.
"""

import re

QUOTED = {
    "first_steps": {
        "frame of 93% of the runs, against 55% for the others": (
            r"sir object 1: success 0\.93 .* ps object 1: success 0\.55 "
            r".* dps object 1: success 0\.55"
        ),
        'carry all the weight, against 33 for `"ps"` and about 18 for `"dps"`': (
            r"effective sample size 3 ps .* sample size 33 dps .* sample size 18\b"
        ),
        "stay within a pixel of the truth on average": r"to the truth, pixels: \[0\.\d* *0\.\d*\]",
        "is 10 and 20 pixels off on average": (
            r"without the far walls, pixels: \[10\.\d* (19\.[5-9]|20\.[0-4])"
        ),
        "is lower by 640": r"walls log evidence 1879\.4 no far walls log evidence 1239\.4",
    },
    "exclusion": {
        "with the product 30 ± 10% do where a line counts 0.3": r"P\', none 37 \+- 15 30 \+- 10 37",
        "in 93 ± 4% of the runs, the product in 37 ± 15%": (
            r"0\.3 P, exclusion 93 \+- 4 0 \+- 0 23 0\.3 P\', none 37 \+- 15"
        ),
        "size of 3 instead of 23, and with exclusion 60 ± 13%": (
            r"1\.0 P, exclusion 60 \+- 13 0 \+- 0 3\b"
        ),
    },
    "helping_points": {
        "from 0.02 to 0.1 it ties two bodies": (
            r"scale 0\.02 6\.3 .* scale 0\.05 5\.7 .* scale 0\.1 2\.7 .* scale 0\.2 0\.8"
        ),
        "its error is below a pixel": r"Lucas-Kanade 0\.4 \[.*\] 0\.2",
    },
    "partitioned_sampling": {
        "12 of 200": r"effective sample size: 12\.1 of 200",
        "36 useful particles instead of 12": (
            r"sample size: 36\.1 of 200 conventional, above: 12\.1"
        ),
        "has a standard deviation of 2.6 over runs, that of the others 0.8 to 0.9": (
            r"SIR A 0\.0960 B 0\.0891 2\.6\d* .* 0\.786 .* 0\.757 .* 0\.886 "
        ),
        "is off by 0.09 to 0.10, that of the others by 0.03 to 0.04": (
            r"PS, A first A 0\.04\d* B 0\.026\d* .* PS, B first A 0\.02[89]\d* B 0\.04\d* "
        ),
    },
    "smith2004": {
        "PS does in 41% of the runs and DPS in 44%": (
            r"PS 1→7 finds object 1 again in 41% .* DPS finds object 1 again in 44%"
        ),
        "-7 to 13 points, contains zero": r"DPS .* 44% of the runs, \+3 \[ -7, \+13\]",
        "object 1 keeps 2.6% distinct particles": r"PS 1→7 uniqueness \(%\): 2\.6 ",
        "between 23 and 28%": r"DPS uniqueness \(%\): 28\.1 22\.8 22\.7 23\.0 23\.2 23\.6 24\.5",
        "its precision falls by nine points, that of PS by four": (
            r"others 93\.0% .* others 90\.7% .* others 89\.0% .* others 81\.7%"
        ),
        "the interval of the gap, -5 to 15": r"drawn twice best - worst \+5 \[ -5, \+15\]",
        "by 23 points": r"stages counted twice best - worst \+23 ",
        "last but one (52%) and least often when it comes last (31%)": r"47 52 31%",
        "DPS falls 17 points behind PS": r"DPS - PS -17 ",
        "cannot be told apart (-12 to 18 points)": r"34% of the runs, \+3 \[ -12, \+18\]",
    },
    "swap_bias": {
        "it estimates 5/16 instead of 1/4": r"none mean 0\.2500 .* sorted_swap mean 0\.3125",
        "by a factor of 1.7 at 3 parts and of some 90 at 11": (
            r" 3 sorted 1\.72\d* .* 11 sorted 90\.6"
        ),
        "converges to 1.75 and 0.89": r"1000 sorted 1\.754 \+- 0\.003 0\.885",
        "sorting and the unbiased rule by 8%": (
            r"relative SPS sorted 7\.7 .* relative SPS combinatorial 8\.1"
        ),
        "on these 25 sequences, with an interval from -10 to 15": (
            r"25 sequences .* SPS sorted 3\.3 \[ -10\.3, 14\.9\]"
        ),
    },
    "tuning": {
        "0.61 for 0.44, a difference of +0.17": (
            r"IoU 0\.44 -> 0\.61, difference \+0\.17 \[\+0\.0[1-9], "
        ),
    },
}


def unprinted(name, notebook):
    """What the prose of a notebook quotes and no cell prints, or says no more."""

    def joined(texts):
        return re.sub(r"\s+", " ", " ".join(texts))

    prose = joined(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    printed = joined(
        output.text
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output.output_type == "stream"
    )
    return [
        words
        for words, pattern in QUOTED.get(name, {}).items()
        if words not in prose or not re.search(pattern, printed)
    ]
