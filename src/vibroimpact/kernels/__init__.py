"""Allocation-free kernels: one certified step of one impact oscillator, or of as many as a vector has lanes.

Symbols here, words above. Within a cell lengths of time are counted in steps, x = tau/h with
h = H/L and L the fastest rate of the cell, so every rate carries a factor h:

u : gap g - y >= 0            p : h u' (minus the velocity times h)
s, c : sin wt, cos wt         n : whole driving periods since time 0
C, K : c h/m, k h^2/m         A, G : f h^2/m, k g h^2/m
th, Q : w h, (w h)^2

so that u'' = -C u' - K u + G - A s in step units. All operations are IEEE multiplications, additions,
divisions, roots and *explicit* fused multiply-adds; no `fastmath` flag is on. The compiler may
therefore neither reorder the certificate's sums nor fuse at will, and a cell's numbers are bit-identical in a
single loop and in vectorised lanes.
"""
