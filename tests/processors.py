"""The tests as other processors would run them: other kernels of numpy, OpenBLAS and libm, other machine code, other threads.

    python tests/processors.py            what is decided (outcomes.py) under every setting, side by side
    python tests/processors.py --suite    the whole test suite under every setting
    python tests/processors.py --only old portable

numpy chooses its kernels by the processor's features (``NPY_DISABLE_CPU_FEATURES`` takes some away), OpenBLAS by its kind
(``OPENBLAS_CORETYPE``), the C library its sin, cos and exp likewise (``GLIBC_TUNABLES``), and numba compiles for it
(``NUMBA_CPU_NAME``). All of these differ in the last bits of what they return, by the order of sums and by fused multiply-adds.
"""

from __future__ import annotations

import argparse
import difflib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
#: Without AVX2 and FMA, and without AVX-512, for the C library.
NO_FMA = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F,-AVX2_Usable,-FMA_Usable"


def dispatched() -> list[str]:
    """Features that numpy would make use of on this processor, beyond those that it is built for."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return [name for name in __cpu_dispatch__ if __cpu_features__.get(name)]


def settings() -> dict[str, dict[str, str]]:
    """Environment variables by the name of a setting."""
    features = dispatched()
    newest = [name for name in features if "512" in name or name == "X86_V4"]
    one = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "NUMBA")}
    two = dict.fromkeys(one, "2")
    portable = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    return {
        "native": one,
        "native, 2 threads": two,
        "old": one
        | portable
        | {"OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": " ".join(features), "GLIBC_TUNABLES": NO_FMA},
        "middle": two
        | {
            "OPENBLAS_CORETYPE": "Haswell",
            "NPY_DISABLE_CPU_FEATURES": " ".join(newest),
            "NUMBA_CPU_NAME": "haswell",
            "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma,+bmi,+bmi2,+popcnt,+sse4.2",
        },
        "new": two | {"OPENBLAS_CORETYPE": "SkylakeX"},
        "portable": two | portable,
        "old BLAS": one | {"OPENBLAS_CORETYPE": "Nehalem"},
        "old numpy and libm": one | {"NPY_DISABLE_CPU_FEATURES": " ".join(features), "GLIBC_TUNABLES": NO_FMA},
    }


def run(name: str, variables: dict[str, str], arguments: list[str]) -> tuple[int, str, float]:
    """Run Python under a setting; its exit code, what it printed, and the seconds that it took."""
    began = time.perf_counter()
    # what is not set here must not come from outside
    known = {key for other in settings().values() for key in other}
    environment = {key: value for key, value in os.environ.items() if key not in known} | {
        k: v for k, v in variables.items() if v
    }
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, cwd=HERE.parent, stdout=subprocess.PIPE, text=True, check=False
    )
    return done.returncode, done.stdout, time.perf_counter() - began


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", action="store_true", help="the whole suite, not only what is decided")
    parser.add_argument("--only", nargs="*", help="names of settings")
    options = parser.parse_args()
    chosen = {name: value for name, value in settings().items() if not options.only or name in options.only}
    if not chosen:
        parser.error(f"--only: expected some of {', '.join(settings())}")
    failed, first = False, ""
    for name, variables in chosen.items():
        arguments = ["-m", "pytest", "-n", "2", "--dist", "loadfile"] if options.suite else [str(HERE / "outcomes.py")]
        code, text, seconds = run(name, variables, arguments)
        if options.suite:
            words = text.strip().splitlines()[-1] if text.strip() else "printed nothing"
        elif code == 0:
            first = first or text
            words = f"{sum(len(part) for part in json.loads(text).values())} outcomes, " + (
                "the same" if text == first else "OTHERS"
            )
            for line in difflib.unified_diff(first.splitlines(), text.splitlines(), "first", name, lineterm="", n=2):
                print(line)
            code = code or int(text != first)
        else:
            words = "failed"
        failed |= code != 0
        print(f"{name}: {words}, exit code {code}, {seconds:.0f} s", flush=True)
        print("    " + " ".join(f"{key}={value!r}" for key, value in variables.items()), flush=True)
        if options.suite and code:
            print(text)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
