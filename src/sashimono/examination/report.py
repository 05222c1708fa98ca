"""What the examination found, in words and as JSON."""

from __future__ import annotations

from collections import Counter

from sashimono.examination.findings import Diagnosis, Finding

FORMAT, VERSION = "sashimono.doctor", 1

_SIGNS = {"error": "ERROR  ", "warning": "warning", "note": "note   "}


def diagnosis_lines(found: Diagnosis) -> list[str]:
    """Return the examination in words: size, fasteners, a line for each finding, and a verdict."""
    count = len(found.assembly) + len(found.broken)
    lines = [f"{count} parts, {found.size_words}"]
    kinds = Counter(f"{each.kind} {each.size}".strip() for each in found.fasteners)
    if kinds:
        lines.append(f"fasteners: {', '.join(f'{number} × {kind}' for kind, number in kinds.most_common())}")
    lines += [finding_line(finding) for finding in found.findings]
    return [*lines, verdict(found)]


def finding_line(finding: Finding) -> str:
    """Return one finding as a line."""
    way_out = f" {finding.way_out}" if finding.way_out else ""
    return f"{_SIGNS[finding.severity]} {finding.message}{way_out}"


def verdict(found: Diagnosis) -> str:
    """Return whether it can be planned, in words."""
    errors = sum(finding.severity == "error" for finding in found.findings)
    warnings = sum(finding.severity == "warning" for finding in found.findings)
    if errors:
        return f"{_number(errors, 'thing')} in the way of a plan, {_number(warnings, 'warning')}"
    return f"nothing stands in the way of a plan, {_number(warnings, 'warning')}"


def _number(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"


def diagnosis_as_dict(found: Diagnosis) -> dict[str, object]:
    """Return what ``sashimono doctor --json`` writes: docs/conventions.md names the fields. Lengths in m."""
    source = found.assembly.source
    return {
        "format": FORMAT,
        "version": VERSION,
        "ok": found.ok,
        "source": None
        if source is None
        else {"path": source.path, "sha256": source.sha256, "unit": source.unit, "split": source.split},
        "parts": len(found.assembly) + len(found.broken),
        "size": list(found.size),
        "size_words": found.size_words,
        "findings": [
            {
                "kind": each.kind,
                "severity": each.severity,
                "parts": list(each.parts),
                "message": each.message,
                "way_out": each.way_out,
            }
            for each in found.findings
        ],
        "overlaps": [
            {
                "first": pair.first,
                "second": pair.second,
                "volume": pair.volume,
                "fraction": pair.fraction,
                "depth": pair.depth,
                "guess": pair.guess,
            }
            for pair in found.overlaps
        ],
        "clearances": [
            {"first": each.first, "second": each.second, "gap": each.gap, "relative": each.relative}
            for each in found.clearances
        ],
        "touching": {name: list(others) for name, others in found.touching.items()},
        "identical": [list(names) for names in found.assembly.identical],
        "fasteners": [
            {"part": each.part, "kind": each.kind, "size": each.size or None, "tool": each.tool}
            for each in found.fasteners
        ],
        "treatments": [{"part": each.part, "planned": each.planned, "how": each.how} for each in found.treatments],
    }
