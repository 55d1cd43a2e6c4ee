//! A small writer of ROS 1 bags and MCAP files, after the formats' descriptions and independent of the readers.

use std::io::Write as _;

/// How a chunk is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    None,
    Lz4,
    Bz2,
    Zstd,
}

impl Packing {
    fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Lz4 => "lz4",
            Self::Bz2 => "bz2",
            Self::Zstd => "zstd",
        }
    }

    fn pack(self, bytes: &[u8]) -> Vec<u8> {
        match self {
            Self::None => bytes.to_vec(),
            Self::Lz4 => {
                let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                encoder.write_all(bytes).unwrap();
                encoder.finish().unwrap()
            }
            Self::Bz2 => {
                let mut encoder =
                    bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
                encoder.write_all(bytes).unwrap();
                encoder.finish().unwrap()
            }
            Self::Zstd => ruzstd::encoding::compress_to_vec(
                bytes,
                ruzstd::encoding::CompressionLevel::Fastest,
            ),
        }
    }
}

/// A message to be written: topic, time in nanoseconds, bytes.
pub(crate) type Written<'a> = (&'a str, i64, Vec<u8>);

/// Topics with the types of their messages.
pub(crate) type Topics<'a> = &'a [(&'a str, &'a str)];

/// Bytes behind their length in four bytes.
fn block(bytes: &[u8]) -> Vec<u8> {
    let mut out = u32::try_from(bytes.len()).unwrap().to_le_bytes().to_vec();
    out.extend(bytes);
    out
}

fn ros_time(time_ns: i64) -> Vec<u8> {
    let mut out = u32::try_from(time_ns / 1_000_000_000)
        .unwrap()
        .to_le_bytes()
        .to_vec();
    out.extend(
        u32::try_from(time_ns % 1_000_000_000)
            .unwrap()
            .to_le_bytes(),
    );
    out
}

/// A record of a ROS 1 bag.
fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let header: Vec<u8> = fields
        .iter()
        .flat_map(|(name, value)| block(&[name.as_bytes(), b"=", value].concat()))
        .collect();
    [block(&header), block(data)].concat()
}

fn number(topics: Topics<'_>, topic: &str) -> u32 {
    let index = topics.iter().position(|(name, _)| *name == topic).unwrap();
    u32::try_from(index).unwrap() + 1
}

/// A ROS 1 bag; `indexed` puts index records behind each chunk of `per_chunk` messages.
pub(crate) fn bag(
    topics: Topics<'_>,
    messages: &[Written<'_>],
    packing: Packing,
    per_chunk: usize,
    indexed: bool,
) -> Vec<u8> {
    let mut out = b"#ROSBAG V2.0\n".to_vec();
    out.extend(record(
        &[("op", &[3]), ("index_pos", &0_u64.to_le_bytes())],
        &[b' '; 64],
    ));
    for (number_of_chunk, chunk) in messages.chunks(per_chunk).enumerate() {
        let mut data = Vec::new();
        if number_of_chunk == 0 {
            for (topic, kind) in topics {
                let conn = number(topics, topic).to_le_bytes();
                let description = [
                    block(format!("topic={topic}").as_bytes()),
                    block(format!("type={kind}").as_bytes()),
                    block(b"md5sum=*"),
                    block(b"message_definition=a=b"),
                ];
                data.extend(record(
                    &[("op", &[7]), ("conn", &conn), ("topic", topic.as_bytes())],
                    &description.concat(),
                ));
            }
        }
        let mut rows: Vec<(u32, Vec<u8>)> = Vec::new();
        for (topic, time_ns, bytes) in chunk {
            let conn = number(topics, topic);
            let offset = u32::try_from(data.len()).unwrap();
            rows.push((
                conn,
                [ros_time(*time_ns), offset.to_le_bytes().to_vec()].concat(),
            ));
            data.extend(record(
                &[
                    ("op", &[2]),
                    ("conn", &conn.to_le_bytes()),
                    ("time", &ros_time(*time_ns)),
                ],
                bytes,
            ));
        }
        let size = u32::try_from(data.len()).unwrap().to_le_bytes();
        out.extend(record(
            &[
                ("op", &[5]),
                ("compression", packing.name().as_bytes()),
                ("size", &size),
            ],
            &packing.pack(&data),
        ));
        for conn in (1..=u32::try_from(topics.len()).unwrap()).filter(|_| indexed) {
            let own: Vec<u8> = rows
                .iter()
                .filter(|(row, _)| *row == conn)
                .flat_map(|(_, row)| row.clone())
                .collect();
            let count = u32::try_from(own.len() / 12).unwrap().to_le_bytes();
            out.extend(record(
                &[
                    ("op", &[4]),
                    ("ver", &1_u32.to_le_bytes()),
                    ("conn", &conn.to_le_bytes()),
                    ("count", &count),
                ],
                &own,
            ));
        }
    }
    out
}

/// A record of an MCAP file.
fn op(kind: u8, body: &[u8]) -> Vec<u8> {
    [
        &[kind][..],
        &u64::try_from(body.len()).unwrap().to_le_bytes(),
        body,
    ]
    .concat()
}

/// An MCAP file; `per_chunk` zero writes messages without chunks, `indexed` message indexes behind each chunk.
pub(crate) fn mcap(
    topics: Topics<'_>,
    messages: &[Written<'_>],
    packing: Packing,
    per_chunk: usize,
    indexed: bool,
) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    let mut out = MAGIC.to_vec();
    out.extend(op(1, &[block(b"ros2"), block(b"tests")].concat()));
    let mut definitions = Vec::new();
    for (topic, kind) in topics {
        let id = u16::try_from(number(topics, topic)).unwrap().to_le_bytes();
        let schema = [
            &id[..],
            &block(kind.as_bytes()),
            &block(b"ros2msg"),
            &block(b"float64 x"),
        ];
        let channel = [
            &id[..],
            &id,
            &block(topic.as_bytes()),
            &block(b"cdr"),
            &block(b""),
        ];
        definitions.extend(op(3, &schema.concat()));
        definitions.extend(op(4, &channel.concat()));
    }
    if per_chunk == 0 {
        out.extend(&definitions);
    }
    for (index, chunk) in messages.chunks(per_chunk.max(1)).enumerate() {
        let mut data = if index == 0 && per_chunk > 0 {
            definitions.clone()
        } else {
            Vec::new()
        };
        let mut rows: Vec<(u32, Vec<u8>)> = Vec::new();
        for (topic, time_ns, bytes) in chunk {
            let id = number(topics, topic);
            let time = u64::try_from(*time_ns).unwrap().to_le_bytes();
            let offset = u64::try_from(data.len()).unwrap().to_le_bytes();
            rows.push((id, [time, offset].concat()));
            let head = [
                &u16::try_from(id).unwrap().to_le_bytes()[..],
                &[0; 4],
                &time,
                &time,
            ];
            data.extend(op(5, &[&head.concat()[..], bytes].concat()));
        }
        if per_chunk == 0 {
            out.extend(data);
            continue;
        }
        let name = if packing == Packing::None {
            ""
        } else {
            packing.name()
        };
        let packed = packing.pack(&data);
        let body = [
            &[0; 16][..],
            &u64::try_from(data.len()).unwrap().to_le_bytes(),
            &crc32fast::hash(&data).to_le_bytes(),
            &block(name.as_bytes()),
            &u64::try_from(packed.len()).unwrap().to_le_bytes(),
            &packed,
        ];
        out.extend(op(6, &body.concat()));
        for id in (1..=u32::try_from(topics.len()).unwrap()).filter(|_| indexed) {
            let own: Vec<u8> = rows
                .iter()
                .filter(|(row, _)| *row == id)
                .flat_map(|(_, row)| row.clone())
                .collect();
            let id = u16::try_from(id).unwrap().to_le_bytes();
            out.extend(op(7, &[&id[..], &block(&own)].concat()));
        }
    }
    out.extend(op(15, &[0; 4]));
    out.extend(op(2, &[0; 20]));
    out.extend(MAGIC);
    out
}

/// A `TwistStamped` in the serialisation of ROS 1 or as little-endian CDR: its speed is `speed`, its frame has a name of
/// four letters.
pub(crate) fn twist_stamped(ros1: bool, stamp_ns: i64, speed: f64) -> Vec<u8> {
    let mut out = if ros1 {
        vec![9, 0, 0, 0]
    } else {
        vec![0, 1, 0, 0]
    };
    out.extend(ros_time(stamp_ns));
    if ros1 {
        out.extend(block(b"base"));
    } else {
        // The text with its zero ends at byte 17 behind the encapsulation; the first number begins at 24.
        out.extend(block(b"base\0"));
        out.extend([0; 7]);
    }
    for value in [speed, 0.0, 0.0, 0.0, 0.0, -0.5 * speed] {
        out.extend(value.to_le_bytes());
    }
    out
}
