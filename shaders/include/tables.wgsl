// Tables with equal numbers of rows, each at its place in one buffer: their columns count as those of one table. The uniform of a
// kernel, `parameters`, has them as `tables`.

struct Tables {
    // Of each table: where it begins, its columns, and its first column among those of all. One that does not exist has no columns.
    places: array<vec4<u32>, MOST_TABLES>,
}

// The place of the table that has this column.
fn table_of(column: u32) -> vec4<u32> {
    var table = parameters.tables.places[0];
    for (var k = 1u; k < MOST_TABLES; k++) {
        let next = parameters.tables.places[k];
        if (next.y > 0u && next.z <= column) {
            table = next;
        }
    }
    return table;
}

// Where a number of that table is.
fn place_of(table: vec4<u32>, row: u32, column: u32) -> u32 {
    return table.x + row * table.y + column - table.z;
}
