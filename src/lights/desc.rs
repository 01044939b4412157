//! What a light is made from.

use std::fmt;
use std::sync::Arc;

use crate::color::Rgb;
use crate::geometry::{Coverage, Shape};
use crate::math::{BoundingSphere, DAffine3, DQuat, DVec3};

use super::SkyImage;
use crate::textures::Texture;

/// Parameters of a light, world space, radiometric units. A kind reads what it needs.
#[derive(Clone, Debug)]
pub struct LightDesc {
    /// A name of [`LIGHTS`](super::LIGHTS).
    pub kind: &'static str,
    /// Name of the node, for messages.
    pub name: String,
    /// Position of point and spot lights, middle of panels.
    pub position: DVec3,
    /// Unit direction in which spot and directional lights and panels shine.
    pub direction: DVec3,
    /// Radiance of surfaces, intensity (W/sr) of points and spots, irradiance (W/m²) of parallel
    /// light.
    pub strength: Rgb,
    /// Spot: half angle in radians within which intensity is full.
    pub inner_cone: f64,
    /// Spot: half angle in radians beyond which there is none.
    pub outer_cone: f64,
    /// Spot: how the intensity falls from the inner to the outer cone.
    pub spot_curve: SpotCurve,
    /// Point and spot: distance in metres at which the light ends; infinite for the square law
    /// alone.
    pub range: f64,
    /// Point and spot: radius in metres; 0 for a light without extent.
    pub radius: f64,
    /// Panel: edges of the rectangle, or of the one around the ellipse, in metres.
    pub edges: [DVec3; 2],
    /// Panel: whether it is an ellipse.
    pub round: bool,
    /// Lights without a surface in the scene: whether camera rays see them. Reflections do.
    pub seen_by_camera: bool,
    /// Area: corners of the triangles, front counter-clockwise; indexed as the mesh is.
    pub triangles: Vec<[DVec3; 3]>,
    /// Area: how the strength varies over the triangles, if it does.
    pub map: Option<EmissionMap>,
    /// Sphere and ellipsoid: centre and radius of each sphere; indexed as the set is.
    pub spheres: Vec<BoundingSphere>,
    /// Ellipsoid: what carries the spheres into the world.
    pub world: DAffine3,
    /// Area: whether the back emits too.
    pub double_sided: bool,
    /// Directional: half the angle that the sun fills, in radians; 0 for parallel light.
    pub angular_radius: f64,
    /// Environment: the image that the strength multiplies; one colour if there is none.
    pub sky: Option<Arc<SkyImage>>,
    /// Environment: world from the image's directions.
    pub rotation: DQuat,
    /// Light from infinity: what it has to cover.
    pub scene: BoundingSphere,
}

/// How a spot's intensity falls from its inner to its outer cone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpotCurve {
    /// The square of a ramp in the cosine, as `KHR_lights_punctual` recommends.
    #[default]
    Gltf,
    /// A smooth step in the cosine whose width is the share `1 − inner/outer` of the whole
    /// cone's, as Cycles has it.
    Cycles,
}

/// How emission varies over a surface.
#[derive(Clone)]
pub struct EmissionMap {
    /// The surface.
    pub shape: Arc<Shape>,
    /// The colour of the emission.
    pub texture: Option<Texture>,
    /// How much of the surface is there.
    pub coverage: Option<Arc<dyn Coverage>>,
}

impl fmt::Debug for EmissionMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EmissionMap")
            .field("texture", &self.texture.is_some())
            .field("whole", &self.coverage.is_none())
            .finish()
    }
}

impl EmissionMap {
    /// The factor at barycentric weights of a triangle's second and third corner.
    pub(super) fn at(&self, prim: u32, barycentrics: [f64; 2]) -> Rgb {
        let mut value = Rgb::ONE;
        if let (Some(texture), Shape::Mesh(mesh)) = (&self.texture, &*self.shape) {
            let uv = mesh.uv(texture.uv_set, prim, barycentrics);
            let [r, g, b, _] = texture.lookup(uv, None);
            value = Rgb::new(r, g, b);
        }
        match &self.coverage {
            Some(c) => value * c.opacity(&self.shape, prim, barycentrics),
            None => value,
        }
    }
}

impl Default for LightDesc {
    fn default() -> Self {
        Self {
            kind: "point",
            name: String::new(),
            position: DVec3::ZERO,
            direction: DVec3::NEG_Z,
            strength: Rgb::ONE,
            inner_cone: 0.0,
            outer_cone: std::f64::consts::FRAC_PI_4,
            spot_curve: SpotCurve::Gltf,
            range: f64::INFINITY,
            radius: 0.0,
            edges: [DVec3::X, DVec3::Y],
            round: false,
            seen_by_camera: true,
            triangles: Vec::new(),
            map: None,
            spheres: Vec::new(),
            world: DAffine3::IDENTITY,
            double_sided: false,
            angular_radius: 0.0,
            sky: None,
            rotation: DQuat::IDENTITY,
            scene: BoundingSphere {
                center: DVec3::ZERO,
                radius: 0.0,
            },
        }
    }
}
