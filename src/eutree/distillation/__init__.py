"""Distillation: a small tree that decides as any teacher does, by cloning, DAgger or VIPER."""

from eutree.distillation.rounds import DistillationReport, DistillationSettings, Round

__all__ = ["DistillationReport", "DistillationSettings", "Round"]
