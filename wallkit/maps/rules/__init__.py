"""Every rule about maps, and `validate`, which runs them over a file.

A new group is a module with a tuple RULES, named here.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from wallkit.errors import ConfigError, MapError, closest
from wallkit.maps.document import Document
from wallkit.maps.labels import Labels
from wallkit.maps.rules import (
    audit,
    cells,
    cues,
    doors,
    fills,
    graph,
    joints,
    junctions,
    localisation,
    openings,
    placement,
    portability,
    rasters,
    references,
    rooms,
    scale,
    schema,
    shapes,
    slices,
    swings,
    taxonomy,
    topology,
    values,
    vocabulary,
    ways,
    xml_bytes,
)
from wallkit.maps.rules.base import Context, Rule
from wallkit.maps.rules.docs import text_from_doc
from wallkit.maps.rules.engine import Report, codes_matching, run
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.maps.xml import parse

if TYPE_CHECKING:
    from wallkit.maps.audit.nouns import Evidence

_GROUPS = (
    *(xml_bytes.RULES, schema.RULES, values.RULES, graph.RULES, joints.RULES),
    *(scale.RULES, shapes.RULES, junctions.RULES, placement.RULES),
    *(openings.RULES, fills.RULES, doors.RULES, swings.RULES, ways.RULES),
    *(rooms.RULES, topology.RULES),
    *(taxonomy.RULES, vocabulary.RULES),
    *(slices.RULES, cells.RULES),
    *(portability.RULES, references.RULES, rasters.RULES),
    *(audit.RULES,),
    *(localisation.RULES, cues.RULES),
)

RULES: dict[str, Rule] = {rule.code: rule for group in _GROUPS for rule in sorted(group, key=lambda rule: rule.code)}

RASTER_SUFFIXES = (".yaml", ".yml")

# groups that a purpose needs, as words for `select`
PROFILES: Mapping[str, tuple[str, ...]] = {
    name: tuple(group for group in groups if any(rule.group == group for rule in RULES.values()))
    for name, groups in {
        "schema": "XSG",
        "geometry": "XSGEOTC",
        "localization": "XSGEOTCLP",
        "simulation": "XSGEOCP",
        "compat": "XSP",
        "raster": "R",
    }.items()
}


def validate(
    file: Path | bytes,
    tolerances: Tolerances | None = None,
    *,
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    source: str = "map",
    in_set: bool = False,
    labels: Labels | None = None,
    today: datetime.date | None = None,
) -> Report:
    """Everything the rules have to say about a map file or its bytes: group R of a map_server YAML, else all others.

    Args:
        select, ignore: codes or prefixes ("WK-E010", "E"); none selected means all. What is selected runs only where the
            groups it builds on hold.
        source: name for messages, for bytes; meshes and images are looked for beside it.
        in_set: the file is one level of several.
        labels: of the segmentation model, by id.
        today: inline ignores that ended before it no longer count.

    Raises:
        MapError: the file cannot be read from disk. ConfigError: no rule begins with a selector.
    """
    if isinstance(file, Path):
        try:
            data = file.read_bytes()
        except OSError as error:
            raise MapError(
                f"cannot read the map: {error.strerror}", where=file, hint="name a .wkmap.urdf file"
            ) from error
        source = str(file)
    else:
        data = file
    selected = selected_codes(select, ignore, with_log=False)
    is_raster = Path(source).suffix.lower() in RASTER_SUFFIXES
    document = Document(source, data) if is_raster else parse(data, source)
    context = Context(document, tolerances or Tolerances(), in_set=in_set, labels=labels)
    fitting = [rule for rule in RULES.values() if (rule.group == "R") == is_raster]
    return run(context, fitting, selected & {rule.code for rule in fitting}, today=today)


def audit_against(
    document: Document,
    evidence: Evidence,
    tolerances: Tolerances,
    *,
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    today: datetime.date | None = None,
) -> Report:
    """What the rules of group A say about a map, by the evidence of a log; arguments as for `validate`.

    Raises:
        ConfigError: no rule of group A begins with a selector.
    """
    context = Context(document, tolerances, evidence=evidence)
    return run(context, list(RULES.values()), selected_codes(select, ignore, with_log=True), today=today)


def selected_codes(select: Sequence[str], ignore: Sequence[str], *, with_log: bool) -> set[str]:
    """The codes of the rules that are asked for, of those that need a log or of those that do not.

    Raises:
        ConfigError: no rule begins with a selector, or all that do are of the other kind.
    """
    codes = {code for code, rule in RULES.items() if rule.needs_log == with_log}
    for selector in select:
        if not codes_matching([selector], RULES) & codes:
            what = "only speaks without a log" if with_log else "needs a log"
            hint = "wallkit map validate MAP" if with_log else "wallkit map audit MAP LOG"
            raise ConfigError(f"'{selector}' {what}", hint=hint)
    chosen = codes_matching(select, RULES) if select else codes
    return (chosen & codes) - codes_matching(ignore, RULES)


def explain(code: str) -> str:
    """The documentation of a rule, by "WK-G001" or "G001".

    Raises:
        ConfigError: there is no such rule.
    """
    full = code.upper() if code.upper().startswith("WK-") else f"WK-{code.upper()}"
    if full not in RULES:
        raise ConfigError(f"there is no map rule '{code}'", hint=closest(full, RULES))
    return text_from_doc(RULES[full])
