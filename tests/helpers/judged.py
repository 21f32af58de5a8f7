"""Verdicts on the claims of a paper."""

from jaxpf.papers.judging.claims import judge_all


def verdicts(paper, study):
    """Key of a claim -> verdict, of what was measured."""
    judged = judge_all(paper.name, paper.quantities(study))
    return {each.claim.key: each.verdict for each in judged}
