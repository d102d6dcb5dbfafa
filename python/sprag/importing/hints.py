"""Properties of a recording, not of the machine: too short contacts, stamps of a polled sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .events import PULSE, Events
from .times import Floats

_SHORT_CONTACT = 1e-3  # [s]
_SHARE_OF_MEDIAN = 1e-3  # of the intervals between closings
# Gaps between batches are longer than those within a batch by more than this factor.
_APART = 10.0
_FEWEST_SMALL = 3
_FEWEST_BATCHES = 12
_SMALLEST_SHARE = 0.1  # of closings in shared batches
# Threshold of the mean of cos(2 pi d / P) over the distances d of batches, which is 1 if all are
# multiples of P. For 12 random distances a search exceeds it with a probability of about 0.1 %.
_COHERENT = 0.95
_LONGEST_DISTANCE = 50.0  # relative to the shortest; longer ones are not used
_MOST_DISTANCES = 2000


@dataclass
class Batches:
    """Time stamps that come in batches, since a sensor is polled."""

    period: float  # of the sensor [s]
    events: int  # number of closings in batches of more than one

    def text(self, closings: int) -> str:
        """Message for the user; `closings`: number of all."""
        return (
            f"time stamps come in batches: {self.events} of {closings} closings share a batch with "
            f"others, and batches are multiples of {self.period:.3g} s apart, as of a sensor that "
            f"is read every {self.period:.3g} s. Its stamps are up to {self.period:.3g} s late and "
            "never early, which no jitter describes. Stamp events where they arise, or read the "
            f"sensor more often; at the least give --offset {0.5 * self.period:.3g} s more and the "
            f"scene events.jitter = {self.period / 12**0.5:.3g}"
        )


def hints_at_bounces(events: Events, figures: list[dict[str, int]]) -> list[str]:
    """Hints, one line each, to use --debounce and --pulse-shorter-than for contacts.

    Of contacts whose sustained contacts, or the pauses between them, are shorter than a millisecond
    or a thousandth of the median interval between their closings.
    """
    hints = []
    for of in figures:
        if not of["sustained"]:
            continue
        own = events[events["contact"] == of["contact"]]
        kind, follows = own["kind"], np.diff(own["t"])
        opens = kind == 2
        lengths = follows[~opens[:-1] & opens[1:]]
        # A pulse is a contact without length: what follows it, follows its opening.
        pauses = follows[(opens[:-1] | (kind[:-1] == PULSE)) & ~opens[1:]]
        intervals = np.diff(own["t"][~opens])
        usual = float(np.median(intervals)) if len(intervals) else 0.0
        limit = max(_SHORT_CONTACT, _SHARE_OF_MEDIAN * usual)
        brief = int((lengths < limit).sum())
        if not brief:
            continue
        quick = int((pauses < limit).sum())
        also = f", and {quick} closings follow an opening as closely" if quick else ""
        hints.append(
            f"contact {of['contact']}: {brief} of {len(lengths)} sustained contacts last less than "
            f"{limit:.3g} s (median {np.median(lengths):.3g} s){also}. Impacts are as short, and "
            "electrical contacts bounce: --pulse-shorter-than T makes impacts of contacts shorter "
            "than T, --debounce T one contact of those that follow within T. A burst of hits of a "
            "stiff structure that lasts longer than a twentieth of the period of the scene's "
            "fastest mode is a sustained contact, not an impact (check_scene names such scenes)"
        )
    return hints


def find_batches(closings: Events) -> Batches | None:
    """Batches, if there are any, of closings in order of time.

    There are if the gaps between closings are of two kinds, more than a factor of ten apart, and
    the distances of the batches are multiples of one period.
    """
    t = closings["t"]
    gaps = np.diff(t)
    between = _smallest_between(np.sort(gaps))
    if between is None:
        return None
    first = np.flatnonzero(np.concatenate([[True], gaps >= between]))
    sizes = np.diff(first, append=len(t))
    distances = np.diff(t[first])
    shared = sizes >= 2
    events = int(sizes[shared].sum())
    if (
        shared.sum() < _FEWEST_SMALL
        or len(first) < _FEWEST_BATCHES
        or events < _SMALLEST_SHARE * len(t)
    ):
        return None
    groups = np.split(closings["contact"], first[1:])
    of_several = sum(len(set(group.tolist())) > 1 for group in groups)
    # A contact that closes several times in a batch may be bouncing instead.
    at_one_instant = not ((gaps > 0.0) & (gaps < between)).any()
    all_impacts = bool((closings["kind"] == PULSE).all())
    if not at_one_instant and not all_impacts and 5 * of_several < shared.sum():
        return None
    period = _common_period(distances)
    return Batches(period, events) if period else None


def _smallest_between(gaps: Floats) -> float | None:
    """The smallest gap above the largest jump, as a factor, of the sorted gaps."""
    end = max(_FEWEST_SMALL, len(gaps) - _FEWEST_BATCHES + 1)
    above, below = gaps[_FEWEST_SMALL:end], gaps[_FEWEST_SMALL - 1 : end - 1]
    with np.errstate(divide="ignore", invalid="ignore"):  # gaps of 0
        jumps = np.where(above > 0.0, above / below, 0.0)
    if not len(jumps) or jumps.max() <= _APART:
        return None
    return float(above[jumps.argmax()])


def _common_period(distances: Floats) -> float:
    """The longest period of which all distances are multiples; 0: none."""
    shortest = distances.min()
    near = distances[distances <= _LONGEST_DISTANCE * shortest][:_MOST_DISTANCES]
    if len(near) + 1 < _FEWEST_BATCHES:
        return 0.0
    step = 0.02 / near.max()
    best = found = 0.0
    for frequency in np.arange(0.8 / shortest, 4.0 / shortest, step):
        now = float(np.cos(2.0 * np.pi * near * frequency).mean())
        if now > best:
            best, found = now, float(frequency)
        elif best >= _COHERENT and now < 0.9 * best:
            break
    return 1.0 / found if best >= _COHERENT else 0.0
