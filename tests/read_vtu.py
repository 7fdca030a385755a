"""Reads a .vtu or .vtp file with independent libraries and prints the bits of every number.

usage: read_vtu.py FILE

There is one line per array: READER ASSOCIATION NAME COMPONENTS VALUES, where READER is meshio or vtk, and VALUES are
hexadecimal: the 64 bits of each floating-point number or integer. The exit code is 3 if no reader is installed; meshio
does not read .vtp files.
"""

import struct
import sys


def show(reader, association, name, components, values):
    bits = []
    for value in values:
        kind = "<d" if isinstance(value, float) else "<q"
        bits.append(struct.pack(kind, value).hex())
    print(reader, association, name, components, " ".join(bits))


def with_meshio(path):
    import meshio

    mesh = meshio.read(path)
    show("meshio", "mesh", "points", 3, mesh.points.reshape(-1).tolist())
    cells = mesh.cells_dict["tetra"]
    show("meshio", "mesh", "elements", 4, cells.reshape(-1).tolist())
    for name, array in mesh.point_data.items():
        show("meshio", "point", name, array.size // len(mesh.points), array.reshape(-1).tolist())
    for name, blocks in mesh.cell_data.items():
        array = blocks[0]
        show("meshio", "cell", name, array.size // len(cells), array.reshape(-1).tolist())


def with_vtk(path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

    reader = vtkXMLPolyDataReader() if path.endswith(".vtp") else vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    show("vtk", "mesh", "points", 3, vtk_to_numpy(grid.GetPoints().GetData()).reshape(-1).tolist())
    elements = []
    for cell in range(grid.GetNumberOfCells()):
        points = grid.GetCell(cell).GetPointIds()
        elements += [points.GetId(k) for k in range(points.GetNumberOfIds())]
    show("vtk", "mesh", "elements", len(elements) // grid.GetNumberOfCells(), elements)
    for association, data in (("point", grid.GetPointData()), ("cell", grid.GetCellData())):
        for k in range(data.GetNumberOfArrays()):
            array = data.GetArray(k)
            values = vtk_to_numpy(array).reshape(-1).tolist()
            show("vtk", association, array.GetName(), array.GetNumberOfComponents(), values)


def main():
    path = sys.argv[1]
    done = 0
    readers = (("vtk", with_vtk),) if path.endswith(".vtp") else (("meshio", with_meshio), ("vtk", with_vtk))
    for name, read in readers:
        try:
            __import__(name if name == "meshio" else "vtkmodules")
        except ImportError:
            print(f"{name} is not installed", file=sys.stderr)
            continue
        read(path)
        done += 1
    sys.exit(0 if done else 3)


main()
