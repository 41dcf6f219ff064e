"""Watches a running machine: samples in, alarm with subsystem out."""
