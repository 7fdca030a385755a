# Sourced by the scripts of this folder.

# write_box FILE CELLS [EVERY]: writes the case of the neo-Hookean cube with so many cells along a side, and with fields after
# every such number of load steps, by default 0: none. The last table of the file is [newton].
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
every = ${3:-0}
[newton]
CASE
}

# force_difference FILE FILE: prints the greatest difference of a force between two tables of loads, relative to the greatest
# force of the first.
force_difference() {
    paste -d ',' "$1" "$2" | awk -F ',' '
        function size(x) { return x < 0 ? -x : x }
        NR == 1 { for (i = 1; i <= NF / 2; i++) if ($i ~ /\.f[xyz]$/) forces[i] = NF / 2 }
        NR > 1 {
            for (i in forces) {
                if (size($i) > most) most = size($i)
                if (size($i - $(i + forces[i])) > worst) worst = size($i - $(i + forces[i]))
            }
        }
        END { printf "%.1e\n", worst / most }'
}
