//! What workers get wrong: partials with faults, and sound ones under the wrong lease.

use clerestory_api::{CORE_MILLISECONDS_HEADER, EXR_MEDIA_TYPE, FENCING_TOKEN_HEADER, ProblemCode};
use exr::prelude::{AnyChannels, AttributeValue, Compression, FlatImage, FlatSamples, Layer, Text, Vec2, f16};
use reqwest::Method;
use serde_json::{Value, json};

use crate::calls::{Call, MAX_BODY_BYTES, Refusal, refused};
use crate::exr_files::{edited, with_attribute, with_huge_claim};
use crate::hand_worker::Delivery;

/// The attribute of a part that says which node it is.
const ATTRIBUTE: &str = "clerestory";

/// A delivery that must be refused.
pub struct BadDelivery {
    /// What is wrong with it.
    pub what: &'static str,
    /// How it is sent.
    pub call: fn(&Delivery) -> Call,
    /// The answer.
    pub refusal: Refusal,
}

impl Delivery {
    /// The upload of a partial as a worker sends it.
    pub fn of(&self, partial: impl Into<Vec<u8>>) -> Call {
        self.under(&self.lease.id.to_string(), partial)
    }

    fn under(&self, lease: &str, partial: impl Into<Vec<u8>>) -> Call {
        Call::new(Method::PUT, format!("/leases/{lease}/partial"))
            .header("content-type", EXR_MEDIA_TYPE)
            .header(FENCING_TOKEN_HEADER, self.lease.token)
            .header(CORE_MILLISECONDS_HEADER, 5)
            .body(partial)
    }

    fn sound(&self) -> Call {
        self.of(self.partial.clone())
    }

    /// With a change to the file.
    fn with_file(&self, edit: impl FnOnce(&mut FlatImage)) -> Call {
        self.of(edited(&self.partial, edit))
    }

    /// With a change to the part of the second node; the first is sound.
    fn with_part(&self, edit: impl FnOnce(&mut Part)) -> Call {
        self.with_file(|file| edit(&mut file.layer_data[1]))
    }

    /// With a change to what the second part says of itself.
    fn with_header(&self, edit: impl FnOnce(&mut Value)) -> Call {
        self.with_part(|part| {
            let mut header = header(part);
            edit(&mut header);
            set_header(part, &header.to_string());
        })
    }

    /// With a change to the values of a channel of the second part.
    fn with_values(&self, channel: &str, edit: impl FnOnce(&mut Vec<f32>)) -> Call {
        self.with_part(|part| {
            let channel = position(part, channel);
            match &mut part.channel_data.list[channel].sample_data {
                FlatSamples::F32(values) => edit(values),
                other => panic!("not 32-bit floats: {other:?}"),
            }
        })
    }
}

type Part = Layer<AnyChannels<FlatSamples>>;

fn header(part: &Part) -> Value {
    match part.attributes.other.get(&Text::from(ATTRIBUTE)) {
        Some(AttributeValue::Text(text)) => serde_json::from_str(&text.to_string()).expect("JSON"),
        other => panic!("the part says of itself {other:?}"),
    }
}

fn set_header(part: &mut Part, json: &str) {
    part.attributes.other.insert(Text::from(ATTRIBUTE), AttributeValue::Text(Text::from(json)));
}

fn position(part: &Part, channel: &str) -> usize {
    let found = part.channel_data.list.iter().position(|other| other.name == *channel);
    found.expect("the part has the channel")
}

/// All bad deliveries, for a farm that gives out two nodes with a lease and takes partials of [`MAX_BODY_BYTES`].
pub fn bad_deliveries() -> Vec<BadDelivery> {
    let mut deliveries = bad_leases();
    deliveries.extend(bad_files());
    deliveries.extend(bad_nodes());
    deliveries.extend(bad_channels());
    deliveries
}

fn bad(what: &'static str, call: fn(&Delivery) -> Call, refusal: Refusal) -> BadDelivery {
    BadDelivery { what, call, refusal }
}

/// A partial that is refused as such.
fn malformed(what: &'static str, says: &'static [&'static str], call: fn(&Delivery) -> Call) -> BadDelivery {
    bad(what, call, refused(422, ProblemCode::InvalidPartial, "body", says))
}

fn bad_leases() -> Vec<BadDelivery> {
    const UNKNOWN_ID: &str = "01890000-0000-7000-8000-000000000000";
    let invalid = |field, says| refused(400, ProblemCode::InvalidField, field, says);
    vec![
        bad(
            "a lease that there is not",
            |delivery| delivery.under(UNKNOWN_ID, delivery.partial.clone()),
            refused(404, ProblemCode::UnknownLease, "lease", &[UNKNOWN_ID]),
        ),
        bad(
            "a lease that is no identity",
            |delivery| delivery.under("seven", delivery.partial.clone()),
            invalid("lease", &["seven", "a UUID"]),
        ),
        bad(
            "the fencing token of another lease",
            |delivery| delivery.sound().without(FENCING_TOKEN_HEADER).header(FENCING_TOKEN_HEADER, 987_654_321),
            refused(
                409,
                ProblemCode::StaleToken,
                FENCING_TOKEN_HEADER,
                &["987654321", "the token that came with the lease"],
            ),
        ),
        bad(
            "no fencing token",
            |delivery| delivery.sound().without(FENCING_TOKEN_HEADER),
            invalid(FENCING_TOKEN_HEADER, &["absent", "a whole number"]),
        ),
        bad(
            "a negative time",
            |delivery| delivery.sound().without(CORE_MILLISECONDS_HEADER).header(CORE_MILLISECONDS_HEADER, -5),
            invalid(CORE_MILLISECONDS_HEADER, &["`-5`", "a whole number, 0 or more"]),
        ),
        bad(
            "a time that nobody can have spent",
            |delivery| delivery.sound().without(CORE_MILLISECONDS_HEADER).header(CORE_MILLISECONDS_HEADER, i64::MAX),
            invalid(CORE_MILLISECONDS_HEADER, &["`9223372036854775807`", "at most 1000000000000 milliseconds"]),
        ),
        bad(
            "a partial that is declared as JSON",
            |delivery| delivery.sound().without("content-type").header("content-type", "application/json"),
            refused(415, ProblemCode::UnsupportedMediaType, "content-type", &["application/json", EXR_MEDIA_TYPE]),
        ),
        bad(
            "a partial that is too large",
            |delivery| delivery.of(vec![0; MAX_BODY_BYTES + 1]),
            refused(413, ProblemCode::BodyTooLarge, "body", &["larger than allowed", "at most 1048576 bytes"]),
        ),
    ]
}

fn bad_files() -> Vec<BadDelivery> {
    let not_exr = &["not an OpenEXR file: it "];
    let damaged = &["the OpenEXR file is damaged"];
    vec![
        malformed("an empty partial", not_exr, |delivery| delivery.of(Vec::new())),
        malformed("a PNG file", not_exr, |delivery| delivery.of(b"\x89PNG\r\n\x1a\n".to_vec())),
        malformed("a partial that ends in its header", damaged, |delivery| delivery.of(&delivery.partial[..100])),
        malformed("a partial that ends before its last pixel", damaged, |delivery| {
            delivery.of(&delivery.partial[..delivery.partial.len() - 1])
        }),
        malformed("a partial with a hole in its pixels", damaged, |delivery| {
            let mut partial = delivery.partial.clone();
            let (start, end) = (partial.len() * 2 / 3, partial.len() * 5 / 6);
            partial[start..end].iter_mut().for_each(|byte| *byte = !*byte);
            delivery.of(partial)
        }),
        malformed(
            "a pixel that lost a bit",
            &["(frame 0, tile ", "its values have the hash", "the header says"],
            |delivery| delivery.with_values("R", |values| values[9] = f32::from_bits(values[9].to_bits() ^ 1)),
        ),
        malformed(
            "a header that claims 60001 pixels each way",
            &["a data window of 60001 x 60001 pixels at (0, 0)", "its tile is 8 x 8"],
            |delivery| delivery.of(with_huge_claim(&delivery.partial)),
        ),
        malformed("a header that claims two thousand million blocks", damaged, |delivery| {
            delivery.of(with_attribute(&delivery.partial, "chunkCount", &[i32::MAX]))
        }),
        malformed(
            "DWA compression, whose decoder trusts the data",
            &["DWAA compression is not supported"],
            |delivery| {
                delivery.with_file(|file| {
                    file.layer_data.iter_mut().for_each(|part| part.encoding.compression = Compression::DWAA(None))
                })
            },
        ),
        malformed("another compression", &["compressed with zip", "it must be rle"], |delivery| {
            delivery.with_part(|part| part.encoding.compression = Compression::ZIP16)
        }),
        malformed("a tile that has been moved", &["8 x 8 pixels at (1", "its tile is 8 x 8 at"], |delivery| {
            delivery.with_part(|part| part.attributes.layer_position = Vec2(1, 40))
        }),
        malformed("a tile of half the size", &["a data window of 8 x 4 pixels", "its tile is 8 x 8"], |delivery| {
            delivery.with_part(|part| {
                part.size = Vec2(8, 4);
                for channel in &mut part.channel_data.list {
                    if let FlatSamples::F32(values) = &mut channel.sample_data {
                        values.truncate(32);
                    }
                }
            })
        }),
    ]
}

fn bad_nodes() -> Vec<BadDelivery> {
    vec![
        malformed(
            "a part that does not say what it is",
            &["part 1: the attribute clerestory", "it is missing"],
            |delivery| delivery.with_part(|part| part.attributes.other.clear()),
        ),
        malformed("a part that says it in half a JSON", &["part 1: the attribute clerestory", "EOF"], |delivery| {
            delivery.with_part(|part| set_header(part, "{\"version\":1,\"job\":"))
        }),
        malformed("a part of a future version", &["part 1: the header has version 3", "reads version 2"], |delivery| {
            delivery.with_header(|header| header["version"] = json!(3))
        }),
        malformed("a part without its number of passes", &["part 1", "missing field `passes`"], |delivery| {
            delivery.with_header(|header| drop(header.as_object_mut().expect("an object").remove("passes")))
        }),
        malformed("fewer samples than none", &["part 1", "samples", "`-4`", "expected u64"], |delivery| {
            delivery.with_header(|header| header["samples"] = json!(-4))
        }),
        malformed("no samples", &["claims samples 0; it must be"], |delivery| {
            delivery.with_header(|header| header["samples"] = json!(0))
        }),
        malformed("a part without its counters", &["part 1", "missing field `counters`"], |delivery| {
            delivery.with_header(|header| drop(header.as_object_mut().expect("an object").remove("counters")))
        }),
        malformed(
            "a counter that nobody knows",
            &["part 1", "counters", "unknown field `bounces`", "`height_evaluations`"],
            |delivery| delivery.with_header(|header| header["counters"]["bounces"] = json!(1)),
        ),
        malformed("samples that nobody rendered", &["claims counters.samples 5; it must be"], |delivery| {
            delivery.with_header(|header| header["counters"]["samples"] = json!(5))
        }),
        malformed(
            "more work than can be done",
            &["claims counters.rays 18446744073709551615", "at most"],
            |delivery| delivery.with_header(|header| header["counters"]["rays"] = json!(u64::MAX)),
        ),
        malformed("more passes than the node has", &["claims passes 7; it must be"], |delivery| {
            delivery.with_header(|header| header["passes"] = json!(7))
        }),
        malformed(
            "samples that were grouped in another way",
            &["8 samples in a pass and 8 in a block", "the job has 4 samples in a pass and 4 in a block"],
            |delivery| {
                delivery
                    .with_header(|header| header["sampling"] = json!({"samples_per_pass": 8, "samples_per_block": 8}))
            },
        ),
        malformed("a partial of another scene", &["a scene with hash 5ce7e", "the job's scene has"], |delivery| {
            delivery.with_header(|header| header["scene_hash"] = json!("5ce7e"))
        }),
        malformed("a partial of another job", &["of job another", "it was sent for job"], |delivery| {
            delivery.with_header(|header| header["job"] = json!("another"))
        }),
        malformed("a node that was not leased", &["index 15) was not leased"], |delivery| {
            delivery.with_header(|header| header["index"] = json!(15))
        }),
        malformed("a node outside of the tree", &["level 40, index 0) was not leased"], |delivery| {
            delivery.with_header(|header| {
                header["level"] = json!(40);
                header["index"] = json!(0);
            })
        }),
        malformed("a tile outside of the image", &["tile 9999", "was not leased"], |delivery| {
            delivery.with_header(|header| header["tile"] = json!(9999))
        }),
        malformed("the same node twice", &["is there twice"], |delivery| {
            delivery.with_file(|file| {
                let mut again = file.layer_data[0].clone();
                again.attributes.layer_name = Some(Text::from("again"));
                file.layer_data[1] = again;
            })
        }),
    ]
}

fn bad_channels() -> Vec<BadDelivery> {
    vec![
        malformed("a partial without green", &["lacks the 32-bit float channel G"], |delivery| {
            delivery.with_part(|part| drop(part.channel_data.list.remove(position(part, "G"))))
        }),
        malformed("a channel too many", &["has a channel A, which it must not have"], |delivery| {
            delivery.with_part(|part| {
                let mut opacity = part.channel_data.list[0].clone();
                opacity.name = Text::from("A");
                part.channel_data.list.insert(0, opacity);
            })
        }),
        malformed("a channel of 16-bit floats", &["lacks the 32-bit float channel R"], |delivery| {
            delivery.with_part(|part| {
                let red = position(part, "R");
                part.channel_data.list[red].sample_data = FlatSamples::F16(vec![f16::ONE; 64]);
            })
        }),
        malformed("a value that is no number", &["layer beauty", "NaN at pixel", "must be finite"], |delivery| {
            delivery.with_values("G", |values| values[10] = f32::NAN)
        }),
        malformed("a value without bound", &["layer beauty", "inf at pixel", "must be finite"], |delivery| {
            delivery.with_values("B", |values| values[0] = f32::INFINITY)
        }),
        malformed("a negative sum of squares", &["layer moment is negative at pixel", "at least 0"], |delivery| {
            delivery.with_values("moment.R", |values| values[63] = -1.0)
        }),
    ]
}
