"""Native code of compiled functions: the same operations in the same order, and so the same bits.

In: CasADi functions
Out: `machine_code.MachineCode`: functions that read and write arrays

`operations` has the table of operations, `lowering` writes a function as LLVM's text with the `instructions`,
`machine_code` makes machine code of it, and `object_folder` keeps that between processes.
"""
