"""Measurements, each beside the bar it is held against: `make bench`, or `python -m benchmarks --only frames,bake`.

One file per table. Times are medians of repeated runs that alternate with what they are compared with; ratios are
medians of the ratios of neighbouring runs, so that a load from elsewhere meets both sides.
"""
