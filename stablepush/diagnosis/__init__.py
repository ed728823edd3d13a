"""Diagnosis of the gap between simulation and reality."""

from stablepush.diagnosis.gap_report import VERDICTS, GapReport, diagnose

__all__ = ["VERDICTS", "GapReport", "diagnose"]
