"""Configurations that differ in settings -> what each setting does, and which configurations are worth their time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wallkit.core.results import Value
from wallkit.core.types import BoolArray
from wallkit.evaluate.best import find_front
from wallkit.evaluate.over_logs import distribution
from wallkit.pipelines.batch.runs import Runs, natural, setting_text
from wallkit.report.batch import Effect, Summary, Trade

COST = "update_mean_ms"
# more values than that are put into as many groups as the second number says
_MOST_LEVELS, _GROUPS = 8, 5
_QUANTILES = 100


def settings_of(runs: Runs) -> dict[str, dict[str, str]]:
    """Of each configuration the settings that not all of them have alike."""
    keys = dict.fromkeys(key for settings in runs.settings for key in settings)
    texts = {key: [setting_text(settings.get(key)) for settings in runs.settings] for key in keys}
    swept = [key for key, values in texts.items() if len(set(values)) > 1]
    return {name: {key: texts[key][i] for key in swept} for i, name in enumerate(runs.configurations)}


def trades_of(summaries: Sequence[Summary], key: str) -> tuple[Trade, ...]:
    """Every configuration that has both numbers."""
    known = [s for s in summaries if key in s.numbers and COST in s.numbers and key != COST]
    costs = np.array([s.numbers[COST].mean.value for s in known])
    losses = np.array([s.numbers[key].mean.value for s in known])
    front = set(find_front(costs, losses).tolist())
    return tuple(Trade(s.name, float(costs[i]), float(losses[i]), i in front) for i, s in enumerate(known))


def quantiles_of(runs: Runs, key: str) -> dict[str, tuple[float, ...]]:
    """At most a hundred numbers that show how the runs of a configuration are spread, its extremes among them."""
    found = {}
    for number, name in enumerate(runs.configurations):
        values = runs.column(key).values[(runs.configuration == number) & runs.is_done]
        values = np.sort(values[np.isfinite(values)])
        ranks = np.linspace(0, max(len(values) - 1, 0), _QUANTILES).round().astype(int)
        found[name] = tuple(values[np.unique(ranks)].tolist()) if len(values) else ()
    return found


def effects_of(rng: np.random.Generator, runs: Runs, key: str) -> tuple[Effect, ...]:
    """For every swept setting the metric at each of its values, the strongest first; none where no two share a value."""
    settings, label = settings_of(runs), runs.column(key).label
    found = []
    for setting in dict.fromkeys(name for own in settings.values() for name in own):
        texts = [settings[name][setting] for name in runs.configurations]
        groups = _groups(texts)
        if len(groups) > 1 and max(int(members.sum()) for _, members in groups) > 1:
            found += _effect(rng, runs, label, setting, groups)
    return tuple(sorted(found, key=lambda effect: -effect.span_percent))


def _effect(
    rng: np.random.Generator, runs: Runs, label: Value, setting: str, groups: Sequence[tuple[str, BoolArray]]
) -> list[Effect]:
    levels, values = [], runs.column(label.key).values
    for text, members in groups:
        rows = members[runs.configuration] & runs.is_done
        spread = distribution(rng, label, values[rows], runs.log[rows])
        if spread is not None:
            levels.append((text, int(members.sum()), spread.mean))
    means = [mean.value for _, _, mean in levels]
    overall = float(np.mean(means)) if means else 0.0
    return [Effect(setting, tuple(levels), 100 * (max(means) - min(means)) / overall)] if overall > 0 else []


def _groups(texts: Sequence[str]) -> list[tuple[str, BoolArray]]:
    """Values of a setting and which configurations have them; many numbers are grouped by size."""
    levels = sorted(set(texts), key=natural)
    # values that were drawn hardly ever come twice
    is_drawn = 3 < len(texts) < 2 * len(levels)
    if len(levels) <= _MOST_LEVELS and not is_drawn:
        return [(level, np.array([text == level for text in texts])) for level in levels]
    try:
        numbers = np.array([float(text) for text in texts])
    except ValueError:
        return []
    edges = np.quantile(numbers, np.linspace(0, 1, min(_GROUPS, len(levels) // 2) + 1))
    index = np.searchsorted(edges[1:-1], numbers, side="right")
    return [
        (f"{numbers[index == i].min():.4g} to {numbers[index == i].max():.4g}", np.asarray(index == i))
        for i in sorted(set(index.tolist()))
    ]
