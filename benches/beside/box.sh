# Sourced by the scripts of this folder.

# write_box FILE CELLS: writes the case of the neo-Hookean cube with so many cells along a side.
write_box() {
    cat >"$1" <<CASE
[mesh]
generate = { shape = "box", cells = [$2, $2, $2], size = [1.0, 1.0, 1.0] }
[[region]]
name = "*"
material = { model = "neo-hookean", youngs_modulus = 1.0e6, poisson_ratio = 0.3 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = 0.3, y = 0.0, z = 0.0 }
[steps]
count = 3
[output]
every = 0
CASE
}
