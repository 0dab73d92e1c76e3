r"""Kernels of systems: n modes, s stops, a load of harmonics; the same step for numbers and for vectors of lanes.

In the coordinates eta of the undamped modes, mass-normalised, and in units of a step of h seconds, with p = eta',

    eta'' = f(x) - L eta - D p - alpha^T lambda,    f = f_0 + sum_m Im(f_m e^{i m theta x}),
    u_z = g_z + sum_m Im(d_zm e^{i m theta x}) - alpha_z . eta >= 0,

L diagonal, D diagonal where damping is proportional. Every derivative of eta at x = 0 follows from the ones before,
`series`; those of the clearances u are sums over the modes. A closed stop is a constraint: lambda holds its clearance's
acceleration at zero, lambda = -(alpha alpha^T)^-1 u''_free over the closed stops, and is a power series too. What is
watched of an open stop is its clearance, of a closed one its lambda: the first zero of any of them ends the flight, and
`step` certifies that it is the first. What happens then stands in `law`.
"""
