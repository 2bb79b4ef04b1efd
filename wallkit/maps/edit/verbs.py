"""Every verb by its words: what one contract test runs over."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from wallkit.maps.edit.add import add_class, add_fixture, add_room, add_wall
from wallkit.maps.edit.add_openings import add_door, add_window
from wallkit.maps.edit.adopt import adopt
from wallkit.maps.edit.changes import Changes
from wallkit.maps.edit.copy import array
from wallkit.maps.edit.cut import cut, fill
from wallkit.maps.edit.origin import reorigin
from wallkit.maps.edit.place import move, rotate
from wallkit.maps.edit.rename import rename
from wallkit.maps.edit.snap import straighten
from wallkit.maps.edit.tree import remove, reparent
from wallkit.maps.edit.units import scale
from wallkit.maps.edit.values import set_values
from wallkit.maps.edit.walls import join, split

# by the words after `wallkit map`
VERBS: Mapping[str, Callable[..., Changes]] = {
    "add wall": add_wall,
    "add door": add_door,
    "add window": add_window,
    "add fixture": add_fixture,
    "add room": add_room,
    "add class": add_class,
    "array": array,
    "move": move,
    "rotate": rotate,
    "rename": rename,
    "remove": remove,
    "reparent": reparent,
    "snap": straighten,
    "cut": cut,
    "fill": fill,
    "split": split,
    "join": join,
    "adopt": adopt,
    "scale": scale,
    "origin": reorigin,
    "set": set_values,
}
