"""Distillation: a small tree that decides as any teacher does, by cloning, DAgger or VIPER."""

from eutree.distillation.distill import DistillationReport, DistillationSettings, Round

__all__ = ["DistillationReport", "DistillationSettings", "Round"]
