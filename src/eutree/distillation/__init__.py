"""Distillation: a small tree that decides as any teacher does, by cloning, DAgger or VIPER."""

from eutree.distillation.report import DistillationReport, Round
from eutree.distillation.settings import DistillationSettings

__all__ = ["DistillationReport", "DistillationSettings", "Round"]
