"""The packed scene: flat arrays of numbers that kernels read, and Phi, Phi_q, gamma and forces evaluated from them.

Imports elements and below. The type of the arrays never changes, so no scene recompiles a kernel.

Begin with packed.py (`pack`, `System`), then equations.py (Phi, Phi_q, Phi_t, gamma, generalised forces). handles.py
finds a body's or joint's coordinates in the arrays; joint_turns.py counts turns of joint angles along a run.
"""
