//! How fast rays meet glass. Each figure stands next to a plain way of doing the same in the same run.
//!
//! `cargo bench -p clerestory-render-core --bench geometry`

use std::hint::black_box;
use std::sync::Arc;

use clerestory_film::counters::Counters;
use clerestory_render_core::geometry::{
    Accelerator, Face, Frame, HeightField, Outline, Pane, PaneBoundary, PaneParts, Ray, SurfaceId,
};
use divan::Bencher;
use divan::counter::ItemsCount;
use glam::{DVec2, DVec3, dvec2};

const SIZE: DVec2 = dvec2(0.5, 0.4);
const COLUMNS: usize = 256;
const ROWS: usize = 256;
const RAYS: usize = 1000;

fn main() {
    divan::main();
}

/// Numbers in [0, 1) without order, the same every time (Martin Roberts' R sequence).
fn noise(i: usize, dimension: i32) -> f64 {
    let x = 0.5 + (i + 1) as f64 * libm::pow(1.324_717_957_244_746, f64::from(-dimension - 1));
    x - libm::floor(x)
}

fn coefficients() -> Vec<f32> {
    let height = |i: usize| {
        let u = dvec2((i % COLUMNS) as f64 / COLUMNS as f64, (i / COLUMNS) as f64 / ROWS as f64) - 0.5;
        0.002 * libm::exp(-20.0 * u.length_squared()) + 0.0003 * libm::sin(60.0 * u.x) * libm::cos(45.0 * u.y)
    };
    (0..COLUMNS * ROWS).map(|i| height(i) as f32).collect()
}

fn field() -> HeightField {
    HeightField::new(coefficients(), COLUMNS, ROWS, SIZE).expect("the grid is filled")
}

fn pane(frame: Frame) -> Pane {
    let back = HeightField::flat(SIZE).expect("the size is positive");
    let parts = PaneParts {
        name: "pane".into(),
        frame,
        outline: Outline::centred(SIZE),
        thickness: 0.004,
        index_of_refraction: 1.5,
        absorption: DVec3::ZERO,
        layers: [DVec3::ZERO; 2],
        faces: [Arc::new(field()), Arc::new(back)],
    };
    Pane::new(parts).expect("the glass is thick enough")
}

fn local_pane() -> Pane {
    pane(Frame::new(DVec3::ZERO, DVec3::X, DVec3::Y))
}

fn points() -> Vec<DVec2> {
    (0..RAYS).map(|i| (dvec2(noise(i, 0), noise(i, 1)) - 0.5) * SIZE).collect()
}

/// Rays from the front through the outline, from 2 m away, with directions at most about `spread` off the given one.
fn rays(direction: DVec3, spread: f64) -> Vec<Ray> {
    let ray = |(i, target): (usize, DVec2)| {
        let offset = DVec3::new(noise(i, 2), noise(i, 3), noise(i, 4)) - 0.5;
        let direction = (direction.normalize() + spread * offset).normalize();
        Ray::new((target * 0.9).extend(0.0) - direction * 2.0, direction)
    };
    points().into_iter().enumerate().map(ray).collect()
}

#[divan::bench_group]
mod evaluation {
    use super::*;

    fn evaluate<T>(bencher: Bencher<'_, '_>, evaluate: impl Fn(&HeightField, DVec2) -> T + Sync) {
        let (field, points) = (field(), points());
        bencher.counter(ItemsCount::new(RAYS)).bench(|| {
            for p in &points {
                black_box(evaluate(&field, *p));
            }
        });
    }

    #[divan::bench]
    fn height(bencher: Bencher<'_, '_>) {
        evaluate(bencher, HeightField::height);
    }

    #[divan::bench]
    fn slope(bencher: Bencher<'_, '_>) {
        evaluate(bencher, HeightField::slope);
    }

    #[divan::bench]
    fn jet(bencher: Bencher<'_, '_>) {
        evaluate(bencher, HeightField::jet);
    }

    /// The jet from the definition of the spline: clamped indices, each sum on its own.
    #[divan::bench]
    fn baseline_jet_by_definition(bencher: Bencher<'_, '_>) {
        let (values, points) = (coefficients(), points());
        let cubic = |f: f64| {
            let r = 1.0 - f;
            let w = [r * r * r, 3.0 * f * f * f - 6.0 * f * f + 4.0, 3.0 * r * r * r - 6.0 * r * r + 4.0, f * f * f];
            let d = [-3.0 * r * r, 9.0 * f * f - 12.0 * f, 3.0 + 6.0 * f - 9.0 * f * f, 3.0 * f * f];
            [w, d, [6.0 * r, 18.0 * f - 12.0, 6.0 - 18.0 * f, 6.0 * f]].map(|w| w.map(|value| value / 6.0))
        };
        bencher.counter(ItemsCount::new(RAYS)).bench(|| {
            for p in &points {
                let a = (*p / SIZE + 0.5) * dvec2(COLUMNS as f64, ROWS as f64) - 0.5;
                let k = a.floor();
                let (x, y) = (cubic(a.x - k.x), cubic(a.y - k.y));
                let mut jet = [0.0; 6];
                for (sum, (m, n)) in jet.iter_mut().zip([(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]) {
                    for (j, wy) in (-1..3).zip(y[n]) {
                        for (i, wx) in (-1..3).zip(x[m]) {
                            let column = (k.x as i64 + i).clamp(0, COLUMNS as i64 - 1) as usize;
                            let row = (k.y as i64 + j).clamp(0, ROWS as i64 - 1) as usize;
                            *sum += wx * wy * f64::from(values[row * COLUMNS + column]);
                        }
                    }
                }
                black_box(jet);
            }
        });
    }
}

#[divan::bench_group]
mod pane_traversal {
    use super::*;

    /// From the air through the front face, straight on through the glass, to the back face.
    fn traverse(bencher: Bencher<'_, '_>, rays: Vec<Ray>) {
        let pane = local_pane();
        bencher.counter(ItemsCount::new(RAYS)).bench(|| {
            let mut counters = Counters::default();
            for ray in &rays {
                if let Some(hit) = pane.intersect_outside(ray, f64::INFINITY, None, &mut counters)
                    && let PaneBoundary::Face(face) = hit.boundary
                {
                    black_box(pane.intersect_inside(&Ray::new(hit.point, ray.direction), Some(face), &mut counters));
                }
            }
            counters
        });
    }

    #[divan::bench]
    fn nearly_perpendicular(bencher: Bencher<'_, '_>) {
        traverse(bencher, rays(DVec3::Z, 0.2));
    }

    #[divan::bench]
    fn oblique(bencher: Bencher<'_, '_>) {
        traverse(bencher, rays(DVec3::new(1.0, 0.5, 1.0), 0.2));
    }

    #[divan::bench]
    fn grazing(bencher: Bencher<'_, '_>) {
        traverse(bencher, rays(DVec3::new(1.0, 0.5, 0.01), 0.01));
    }

    /// The front face alone, by steps of a hundredth of the relief and bisection: what needs no bounds, and may miss.
    #[divan::bench]
    fn baseline_front_face_by_marching(bencher: Bencher<'_, '_>) {
        let (field, rays) = (field(), rays(DVec3::Z, 0.2));
        let heights = field.all_bounds().height;
        bencher.counter(ItemsCount::new(RAYS)).bench(|| {
            for ray in &rays {
                let below = |t: f64| ray.at(t).z < field.height(ray.at(t).truncate());
                let at = |z: f64| (z - ray.origin.z) / ray.direction.z;
                let (start, step) = (at(heights.min), (at(heights.max) - at(heights.min)) / 100.0);
                let first = (1..=100).find(|i| !below(start + step * f64::from(*i))).unwrap_or(100);
                let (mut low, mut high) = (start + step * f64::from(first - 1), start + step * f64::from(first));
                for _ in 0..45 {
                    let middle = 0.5 * (low + high);
                    if below(middle) { low = middle } else { high = middle }
                }
                black_box(field.slope(ray.at(high).truncate()));
            }
        });
    }
}

#[divan::bench_group]
mod room {
    use super::*;

    /// A bumpy box of 8 x 8 x 6 m with 2 x 2 panes in one wall.
    struct Room {
        positions: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
        accelerator: Accelerator,
    }

    fn room(squares: u32) -> Room {
        let n = squares + 1;
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for side in 0..6usize {
            let start = positions.len() as u32;
            for i in 0..n * n {
                let (axis, sign) = (side / 2, if side % 2 == 0 { -1.0 } else { 1.0 });
                let bump = 0.02 * noise(i as usize, side as i32);
                let p = dvec2(f64::from(i % n), f64::from(i / n)) / f64::from(squares) * 2.0 - 1.0;
                let mut corner = [0.0; 3];
                corner[axis] = sign * (1.0 - bump);
                corner[(axis + 1) % 3] = p.x;
                corner[(axis + 2) % 3] = p.y;
                positions.push(DVec3::from(corner) * DVec3::new(4.0, 4.0, 3.0));
            }
            for i in 0..squares * squares {
                let a = start + i / squares * n + i % squares;
                triangles.extend([[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]);
            }
        }
        let panes = (0..4).map(|i| {
            let origin = DVec3::new(f64::from(i % 2) * 0.6 - 0.3, 3.8, f64::from(i / 2) * 0.5);
            pane(Frame::new(origin, DVec3::X, DVec3::Z))
        });
        let accelerator = Accelerator::build(&positions, &triangles, &[], panes.collect()).expect("the mesh is sound");
        Room { positions, triangles, accelerator }
    }

    fn rays_in_room() -> Vec<Ray> {
        let ray = |i| {
            let from = (DVec3::new(noise(i, 0), noise(i, 1), noise(i, 2)) - 0.5) * DVec3::new(6.0, 6.0, 4.0);
            Ray::new(from, (DVec3::new(noise(i, 3), noise(i, 4), noise(i, 5)) - 0.5).normalize())
        };
        (0..RAYS).map(ray).collect()
    }

    #[divan::bench]
    fn closest_hit(bencher: Bencher<'_, '_>) {
        let (room, rays) = (room(60), rays_in_room());
        bencher.counter(ItemsCount::new(RAYS)).bench(|| {
            let mut counters = Counters::default();
            for ray in &rays {
                black_box(room.accelerator.closest_hit(ray, f64::INFINITY, SurfaceId::Nothing, &mut counters));
            }
        });
    }

    #[divan::bench]
    fn occluded(bencher: Bencher<'_, '_>) {
        let (room, rays) = (room(60), rays_in_room());
        bencher.counter(ItemsCount::new(RAYS)).bench(|| {
            let mut counters = Counters::default();
            for ray in &rays {
                black_box(room.accelerator.occluded(ray, 2.0, SurfaceId::Nothing, None, &mut counters));
            }
        });
    }

    /// Every triangle by the test of Möller and Trumbore, on ten of the rays.
    #[divan::bench]
    fn baseline_closest_hit_by_brute_force(bencher: Bencher<'_, '_>) {
        let (room, rays) = (room(60), rays_in_room());
        bencher.counter(ItemsCount::new(10usize)).bench(|| {
            for ray in &rays[..10] {
                let distance = |triangle: &[u32; 3]| {
                    let [a, b, c] = triangle.map(|i| room.positions[i as usize]);
                    let (ab, ac, ao) = (b - a, c - a, ray.origin - a);
                    let across = ray.direction.cross(ac);
                    let inverse = 1.0 / ab.dot(across);
                    let (u, v) = (ao.dot(across) * inverse, ray.direction.dot(ao.cross(ab)) * inverse);
                    let t = ac.dot(ao.cross(ab)) * inverse;
                    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 { t } else { f64::INFINITY }
                };
                black_box(room.triangles.iter().map(distance).fold(f64::INFINITY, f64::min));
            }
        });
    }

    #[divan::bench]
    fn through_the_window(bencher: Bencher<'_, '_>) {
        let (room, points) = (room(60), points());
        let rays: Vec<_> = points
            .into_iter()
            .map(|p| {
                let (from, to) = (DVec3::new(0.5, -2.0, -1.0), DVec3::new(p.x * 2.0, 3.8, 0.25 + p.y * 2.0));
                Ray::new(from, (to - from).normalize())
            })
            .collect();
        bencher.counter(ItemsCount::new(RAYS)).bench(|| {
            let mut counters = Counters::default();
            for ray in &rays {
                let hit = room.accelerator.closest_hit(ray, f64::INFINITY, SurfaceId::Nothing, &mut counters);
                if let Some(hit) = hit
                    && let clerestory_render_core::geometry::Surface::Pane { index, .. } = hit.surface
                {
                    let inside = Ray::new(ray.at(hit.distance), ray.direction);
                    let ray_origin = Some(Face::Back);
                    black_box(room.accelerator.closest_hit_inside(index, &inside, ray_origin, &mut counters));
                }
            }
        });
    }
}
