#!/usr/bin/python3
"""Runs master, observer (1 kHz) and logger over LCM for MINUTES with stress-ng on all processors,
and prints deadlines and memory. Fails if ticks stay unsettled, events are lost or memory grows.

usage: soak.py MINUTES [--realtime]    --realtime: the observer under SCHED_FIFO
"""
import json
import os
import subprocess
import sys
import time
from pathlib import Path

from machines import ROOT

PROGRAMS = {
    "logger": "tools/sync_logger",
    "observer": "observer/observer",
    "master": "master_sim/master_sim",
}
QUANTILES = ("p50", "p99", "p999", "max")


def megabytes(process: subprocess.Popen[bytes]) -> float:
    with open(f"/proc/{process.pid}/status", encoding="utf-8") as file:
        size = (line.split()[1] for line in file if line.startswith("VmRSS"))
        return int(next(size, "0")) / 1e3


def main() -> None:
    if len(sys.argv) not in (2, 3) or not sys.argv[1].isdigit():
        sys.exit(__doc__)
    duration, out = 60 * int(sys.argv[1]), ROOT / "out" / "soak"
    out.mkdir(parents=True, exist_ok=True)
    load = ["stress-ng", "--cpu", str(os.cpu_count()), "--timeout", f"{duration + 60}", "--quiet"]
    stress = subprocess.Popen(load)
    processes = {}
    try:
        for name, program in PROGRAMS.items():
            command: list[str | Path] = [
                ROOT / "build" / program,
                "paper_beam",
                "--duration",
                f"{duration}",
            ]
            command += [
                "--url",
                "udpm://239.255.76.67:7687?ttl=0",
                "--report",
                out / f"{name}.json",
            ]
            if name == "observer":
                command += ["--estimator", "replica", *sys.argv[2:]]
            if name == "logger":
                command += ["--csv", out / "V.csv"]
            processes[name] = subprocess.Popen(command, stderr=subprocess.DEVNULL)
            time.sleep(1.0)
        # Memory that is touched first within the first tenth does not count as growth.
        time.sleep(duration / 10)
        early = {name: megabytes(process) for name, process in processes.items()}
        time.sleep(duration * 0.85)
        late = {name: megabytes(process) for name, process in processes.items()}
        failed = [name for name, process in processes.items() if process.wait(120) != 0]
    finally:
        for process in [stress, *processes.values()]:
            process.terminate()
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")
    report = json.loads((out / "observer.json").read_text(encoding="utf-8"))
    print("| what | figure |\n|---|---|")
    print(f"| missed deadlines | {report['missed_deadlines']} of {report['ticks_with_deadline']} |")
    for what, key in (
        ("lateness of a tick", "lateness_s"),
        ("execution of a turn", "execution_s"),
        ("event to estimate", "event_latency_s"),
    ):
        figures = " / ".join(f"{1e6 * report[key][q]:.0f}" for q in QUANTILES)
        print(f"| {what}: p50 / p99 / p99.9 / max [us] | {figures} |")
    print(f"| unsettled ticks | {report['unsettled_ticks']} |")
    print(f"| messages and events lost | {report['messages']['lost']}, {report['lost_records']} |")
    for name in PROGRAMS:
        print(
            f"| memory of the {name}, early and late [MB] | {early[name]:.1f}, {late[name]:.1f} |"
        )
    grows = [name for name in PROGRAMS if late[name] > early[name] + 2.0]
    if report["unsettled_ticks"] or report["lost_records"] or grows:
        sys.exit(f"not clean: ticks are unsettled, events were lost, or memory grows: {grows}")


if __name__ == "__main__":
    main()
