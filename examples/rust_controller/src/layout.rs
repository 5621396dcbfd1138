//! Output of `lapwing protocol SCENE --json FILE`: ports, their columns, and the run configuration.

use std::collections::HashMap;

use serde_json::Value;

/// Port of a service with the positions of its columns.
pub struct Port {
    pub name: String,
    pub period: i64,
    width: usize,
    place: HashMap<String, usize>,
}

/// Row of a port: one number for each column.
pub type Row = Vec<f64>;

impl Port {
    pub fn get(&self, row: &[f64], column: &str) -> f64 {
        row[self.place[column]]
    }

    pub fn three(&self, row: &[f64], column: &str) -> [f64; 3] {
        [0, 1, 2].map(|i| self.get(row, &format!("{column}.{i}")))
    }

    pub fn blank(&self) -> Row {
        vec![0.0; self.width]
    }

    pub fn set(&self, row: &mut Row, column: &str, value: f64) {
        row[self.place[column]] = value;
    }

    pub fn set_all(&self, row: &mut Row, column: &str, values: &[f64]) {
        for (i, value) in values.iter().enumerate() {
            self.set(row, &format!("{column}.{i}"), *value);
        }
    }

    /// Return the row of this port in the step packet of a tick, which has the due ports in order.
    pub fn find(&self, ports: &[Port], packet: &[u8], tick: i64) -> Row {
        let before: usize = ports
            .iter()
            .take_while(|p| p.name != self.name)
            .filter(|p| tick % p.period == 0)
            .map(|p| p.width)
            .sum();
        packet[8 * before..8 * (before + self.width)]
            .chunks(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
            .collect()
    }
}

/// Data of the run that this program needs.
pub struct Layout {
    pub interval_ns: i64,
    pub services: Vec<String>,
    pub config_text: String,
    pub config: Value,
    tree: Value,
}

impl Layout {
    pub fn read(path: &str) -> Layout {
        let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{path}: {e}"));
        let tree: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path}: {e}"));
        let config_text = tree["config"].as_str().expect("config").to_string();
        Layout {
            interval_ns: tree["interval_ns"].as_i64().expect("interval_ns"),
            services: tree["services"]
                .as_object()
                .expect("services")
                .keys()
                .cloned()
                .collect(),
            config: serde_json::from_str(&config_text).expect("config"),
            config_text,
            tree,
        }
    }

    /// Return the ports of a service in the order of its step packets.
    pub fn ports(&self, service: &str) -> Vec<Port> {
        let ports = self.tree["services"][service]["ports"]
            .as_array()
            .expect("ports");
        ports
            .iter()
            .map(|p| {
                let columns: Vec<&str> = p["columns"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|c| c.as_str().unwrap())
                    .collect();
                Port {
                    name: p["name"].as_str().unwrap().to_string(),
                    period: p["period"].as_i64().unwrap(),
                    width: columns.len(),
                    place: columns
                        .iter()
                        .enumerate()
                        .map(|(i, c)| (c.to_string(), i))
                        .collect(),
                }
            })
            .collect()
    }
}

/// Return a tuple of the run configuration as numbers.
pub fn numbers(value: &Value) -> Vec<f64> {
    value["of"]
        .as_array()
        .expect("a tuple")
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}
