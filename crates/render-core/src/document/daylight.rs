//! The light of a place and an hour: where a scene is on earth, when it is, and the sun and the sky of that.
//!
//! `site` and `moment` of a scene say where the sun stands. Its `daylight` becomes two lights, `sun` and `sky`, when
//! the scene is [expanded](SceneDescription::expanded).

use std::f64::consts::PI;

use glam::DVec3;

use super::SceneDescription;
use super::daylight_description::{MomentDescription, SiteDescription, SunStrength};
use crate::light::{EnvironmentLight, EnvironmentRadiance, LightDescription, SkyModel, SkySettings, SunLight};
use crate::settings::check::{check_direction, check_range};
use crate::settings::{Check, JsonPath, SceneError};
use crate::site::{
    self, LUMINOUS_EFFICACY, Moment, Place, SiteError, SunPosition, UniversalTime, clear_skylight, clear_sunlight,
    sun_position,
};

/// Sine of the least angle between up and north.
const LEAST_SINE: f64 = 1e-3;

impl SiteDescription {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        self.place(path)?;
        check_range(self.azimuth, -360.0, 360.0, &path.member("azimuth"))?;
        let up = check_direction(self.up, &path.member("up"))?;
        let axis = check_direction(self.axis, &path.member("axis"))?;
        if axis.cross(up).length() < LEAST_SINE {
            return Err(SceneError::value(&path.member("axis"), "a direction along up", "a direction across up"));
        }
        Ok(())
    }

    fn place(&self, path: &JsonPath<'_>) -> Result<Place, SceneError> {
        Place::new(self.latitude, self.longitude, self.elevation).map_err(|error| of_site(path, &error))
    }

    /// The direction of an altitude above the horizon and an azimuth from north by east, degrees.
    fn direction(&self, altitude: f64, azimuth: f64) -> DVec3 {
        let up = DVec3::from(self.up).normalize();
        let axis = DVec3::from(self.axis).normalize();
        let along = (axis - up * axis.dot(up)).normalize();
        // East of the axis: with z up and y to the north, x is to the east.
        let across = along.cross(up);
        let (sin, cos) = libm::sincos((azimuth - self.azimuth).to_radians());
        let (rise, reach) = libm::sincos(altitude.to_radians());
        up * rise + (along * cos + across * sin) * reach
    }
}

impl MomentDescription {
    fn read(&self) -> Result<Moment, SiteError> {
        let calendar = self.calendar.as_deref().map(str::parse).transpose()?;
        let time = self.time.as_deref().map(str::parse).transpose()?;
        let reading = self.hour_reading.as_deref().map(str::parse).transpose()?;
        Moment::parse(&self.at, calendar, time, reading.unwrap_or_default())
    }
}

/// The site and the moment of a scene, and where the sun stands.
#[derive(Clone, Debug)]
pub struct SunOfScene {
    /// Where.
    pub place: Place,
    /// When, as the scene has it.
    pub moment: Moment,
    /// The same in universal time.
    pub time: UniversalTime,
    /// Where the sun stands.
    pub position: SunPosition,
}

impl SceneDescription {
    /// Where the sun stands at the site and the moment of the scene; `None` where it lacks either.
    ///
    /// # Errors
    ///
    /// When the site or the moment makes no sense.
    pub fn sun(&self) -> Result<Option<SunOfScene>, SceneError> {
        let (Some(site), Some(moment)) = (&self.site, &self.moment) else { return Ok(None) };
        let root = JsonPath::Root;
        let place = site.place(&root.member("site"))?;
        let of_moment = |error: SiteError| of_site(&root.member("moment"), &error);
        let moment = moment.read().map_err(of_moment)?;
        let time = moment.universal(&place).map_err(of_moment)?;
        let position = sun_position(&place, time).map_err(of_moment)?;
        Ok(Some(SunOfScene { place, moment, time, position }))
    }

    /// Checks what the scene says of its place, its hour and their light.
    pub(super) fn check_daylight(&self) -> Check {
        let root = JsonPath::Root;
        if let Some(site) = &self.site {
            site.check(&root.member("site"))?;
        }
        if let Some(moment) = &self.moment {
            moment.read().map_err(|error| of_site(&root.member("moment"), &error))?;
        }
        self.sun()?;
        let Some(daylight) = &self.daylight else { return Ok(()) };
        let path = root.member("daylight");
        if self.site.is_none() {
            return Err(SceneError::value(&root.member("site"), "nothing", "the place of the scene's daylight"));
        }
        match daylight.sun {
            SunStrength::Turbidity(turbidity) => {
                check_range(turbidity, 1.0, 20.0, &path.member("sun").member("turbidity"))?;
            }
            SunStrength::Illuminance(illuminance) => {
                check_range(illuminance, 0.0, 150_000.0, &path.member("sun").member("illuminance"))?;
            }
            SunStrength::Perez if !matches!(daylight.sky, SkyModel::Perez { .. }) => {
                return Err(SceneError::value(&path.member("sun"), "perez", "another strength, or the sky perez"));
            }
            SunStrength::Perez | SunStrength::None => {}
        }
        check_range(daylight.ground_reflectance, 0.0, 1.0, &path.member("ground_reflectance"))?;
        if let Some(illuminance) = daylight.sky_illuminance {
            check_range(illuminance, 0.0, 1e6, &path.member("sky_illuminance"))?;
        }
        daylight.sky.check(&path.member("sky"))
    }

    /// Makes lights of the daylight. A scene without a moment is one that options give a moment later.
    pub(super) fn take_daylight(&mut self) -> Check {
        let (Some(daylight), Some(site)) = (self.daylight.take(), self.site.clone()) else { return Ok(()) };
        let Some(sun) = self.sun()? else {
            let expected = "the hour of the scene's daylight, such as {\"at\": \"1250-06-24T09:00Z\"}";
            return Err(SceneError::value(&JsonPath::Root.member("moment"), "nothing", expected));
        };
        let SunPosition { altitude, azimuth, angular_radius, .. } = sun.position;
        if altitude <= 0.0 {
            // At night there is neither.
            return Ok(());
        }
        let direction = site.direction(altitude, azimuth);
        let measured = daylight.sky.perez(altitude, sun.position.distance);
        let strength = match daylight.sun {
            SunStrength::Turbidity(turbidity) => clear_sunlight(&sun.position, turbidity),
            SunStrength::Illuminance(illuminance) => illuminance,
            SunStrength::Perez => measured.map_or(0.0, |sky| sky.direct_illuminance),
            SunStrength::None => 0.0,
        };
        if strength > 0.0 {
            let sine = libm::sin(angular_radius.to_radians());
            let radiance = strength / (LUMINOUS_EFFICACY * PI * sine * sine);
            self.lights.push(LightDescription::Sun(SunLight {
                name: "sun".to_owned(),
                direction: direction.to_array(),
                angular_radius,
                radiance: site::sunlight_colour(altitude).map(|part| part * radiance),
            }));
        }
        let by_model = measured.map_or_else(|| clear_skylight(&sun.position), |sky| sky.diffuse_illuminance);
        let illuminance = daylight.sky_illuminance.unwrap_or(by_model);
        let on_ground = illuminance + strength * libm::sin(altitude.to_radians());
        self.lights.push(LightDescription::Environment(EnvironmentLight {
            name: "sky".to_owned(),
            radiance: EnvironmentRadiance::Sky(SkySettings {
                model: daylight.sky,
                up: site.up,
                sun: Some(direction.to_array()),
                illuminance: Some(illuminance),
                ground_luminance: daylight.ground_reflectance * on_ground / PI,
            }),
            scale: 1.0,
            rotate: [0.0; 3],
        }));
        Ok(())
    }
}

fn of_site(path: &JsonPath<'_>, error: &SiteError) -> SceneError {
    SceneError::Structure { path: path.to_string(), message: error.to_string() }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::{Value, json};

    use super::super::malformed_scenes::valid_scene;
    use super::*;

    fn scene(site: Value, moment: Value, daylight: Value) -> Result<SceneDescription, SceneError> {
        let mut scene = valid_scene();
        scene["lights"] = json!([]);
        scene["site"] = site;
        scene["moment"] = moment;
        scene["daylight"] = daylight;
        SceneDescription::parse(scene.to_string().as_bytes())
    }

    fn chartres() -> Value {
        json!({"latitude": 48.4476, "longitude": 1.4878})
    }

    /// The lights that daylight becomes.
    fn lights(scene: &SceneDescription) -> Vec<LightDescription> {
        let expanded = scene.expanded(&BTreeMap::new()).unwrap();
        expanded.lights[scene.lights.len()..].to_vec()
    }

    #[test]
    fn at_noon_the_sun_is_in_the_south_of_the_scene() {
        let moment = json!({"at": "1250-christmas noon", "calendar": "julian"});
        let upright = scene(chartres(), moment.clone(), json!({})).unwrap();
        let [LightDescription::Sun(sun), LightDescription::Environment(_)] = &lights(&upright)[..] else { panic!() };
        assert!(sun.direction[0].abs() < 1e-4 && sun.direction[1] < -0.9, "south is -y: {sun:?}");
        let altitude = upright.sun().unwrap().unwrap().position.altitude;
        assert!((sun.direction[2] - libm::sin(altitude.to_radians())).abs() < 1e-9 && (18.0..19.0).contains(&altitude));
        // The same church with y up, whose choir lies towards -z and 80 degrees from north by east.
        let mut turned = chartres();
        turned["up"] = json!([0, 1, 0]);
        turned["axis"] = json!([0, 0.5, -1]);
        turned["azimuth"] = json!(80);
        let turned = scene(turned, moment, json!({})).unwrap();
        let [LightDescription::Sun(sun), _] = &lights(&turned)[..] else { panic!() };
        let azimuth = libm::atan2(sun.direction[0], -sun.direction[2]).to_degrees() + 80.0;
        assert!((azimuth - 180.0).abs() < 1e-2, "{azimuth}: x is to the right of -z");
    }

    #[test]
    fn the_sun_and_the_ground_have_the_illuminances_that_are_given() {
        let moment = json!({"at": "2023-06-21T12:00Z"});
        let daylight = json!({"sun": {"illuminance": 90_000}, "sky_illuminance": 15_000, "ground_reflectance": 0.25});
        let scene = scene(chartres(), moment, daylight).unwrap();
        let [LightDescription::Sun(sun), LightDescription::Environment(sky)] = &lights(&scene)[..] else { panic!() };
        let sine = libm::sin(sun.angular_radius.to_radians());
        let weights = [0.2126, 0.7152, 0.0722];
        let luminance: f64 = sun.radiance.iter().zip(weights).map(|(part, weight)| 683.0 * part * weight).sum();
        assert!((luminance * PI * sine * sine / 90_000.0 - 1.0).abs() < 1e-9);
        let EnvironmentRadiance::Sky(sky) = &sky.radiance else { panic!() };
        let expected = 0.25 * (15_000.0 + 90_000.0 * sun.direction[2]) / PI;
        assert!((sky.ground_luminance / expected - 1.0).abs() < 1e-9 && sky.illuminance == Some(15_000.0));
    }

    #[test]
    fn at_night_and_behind_clouds_there_is_no_sun() {
        let night = scene(chartres(), json!({"at": "2023-06-21T00:00Z"}), json!({})).unwrap();
        assert!(lights(&night).is_empty());
        let clouds = json!({"sun": "none", "sky": "overcast"});
        let clouds = scene(chartres(), json!({"at": "2023-06-21T12:00Z"}), clouds).unwrap();
        assert!(matches!(&lights(&clouds)[..], [LightDescription::Environment(_)]));
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_its_place() {
        let noon = || json!({"at": "2023-06-21T12:00Z"});
        let refused = |result: Result<SceneDescription, SceneError>, parts: &[&str]| {
            let error = result.unwrap_err().to_string();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        };
        let with = |member: &str, value: Value| {
            let mut site = chartres();
            site[member] = value;
            site
        };
        refused(scene(with("latitude", json!(91)), noon(), json!({})), &["site", "latitude", "91"]);
        refused(scene(with("axis", json!([0, 0, 1])), noon(), json!({})), &["site.axis", "up"]);
        refused(scene(chartres(), json!({"at": "2023-06-21T12:00"}), json!({})), &["moment", "apparent"]);
        refused(scene(chartres(), json!({"at": "1250-yule noon"}), json!({})), &["moment", "yule"]);
        refused(scene(chartres(), noon(), json!({"sun": "perez"})), &["daylight.sun", "perez"]);
        refused(scene(chartres(), noon(), json!({"sky": {"cie": 99}})), &["daylight.sky.cie", "99"]);
        let mut homeless = valid_scene();
        homeless["daylight"] = json!({});
        refused(SceneDescription::parse(homeless.to_string().as_bytes()), &["site", "nothing", "daylight"]);
        homeless["site"] = chartres();
        let timeless = SceneDescription::parse(homeless.to_string().as_bytes()).unwrap();
        refused(timeless.expanded(&BTreeMap::new()).map(|scene| scene.into_owned()), &["moment", "nothing", "at"]);
    }
}
