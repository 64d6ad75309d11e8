//! Writes the layout checks and the trait implementations.

use proc_macro2::{Span, TokenStream};
use quote::{quote, quote_spanned};
use syn::Type;
use syn::spanned::Spanned;

use crate::parse::{Field, Message};

pub fn emit(message: &Message) -> TokenStream {
    let Message { ident, name, doc, fields, tail, krate } = message;
    let checks = layout_checks(message);
    let described = fields.iter().map(|field| describe(message, field));
    let has_tail = tail.is_some();
    let tail_type = tail.as_ref().map_or(quote!(#krate::NoTail), |tail| quote!(#tail));
    let tail_element = match tail {
        Some(tail) => quote_spanned!(at(tail)=> ::core::option::Option::Some(#krate::Element::of::<#tail>())),
        None => quote!(::core::option::Option::None),
    };
    // Spanned at the struct's name: that is where a missing Clone or Copy is reported.
    let unsafe_impls = quote_spanned! {at(ident)=>
        // SAFETY: all fields are Plain, hence Zeroable; the checks below name every one of them.
        #[allow(unsafe_code, clippy::undocumented_unsafe_blocks)]
        #[automatically_derived]
        unsafe impl #krate::bytemuck::Zeroable for #ident {}
        // SAFETY: repr(C), all fields are Plain, hence Pod, and the checks below refuse padding.
        #[allow(unsafe_code, clippy::undocumented_unsafe_blocks)]
        #[automatically_derived]
        unsafe impl #krate::bytemuck::Pod for #ident {}
    };
    quote! {
        #checks
        #unsafe_impls
        #[automatically_derived]
        impl #krate::Plain for #ident {
            const NESTS: bool = !#has_tail;

            fn kind() -> #krate::Kind {
                #krate::Kind::Struct(::std::boxed::Box::new(<#ident as #krate::Message>::schema()))
            }
        }
        #[automatically_derived]
        impl #krate::Message for #ident {
            type Tail = #tail_type;
            const NAME: &'static str = #name;
            const HAS_TAIL: bool = #has_tail;

            fn schema() -> #krate::Schema {
                #krate::Schema::new(
                    #name,
                    ::core::mem::size_of::<#ident>(),
                    ::std::vec![#(#described),*],
                    #tail_element,
                    #doc,
                )
            }

            fn schema_text() -> &'static #krate::SchemaText {
                static TEXT: ::std::sync::OnceLock<#krate::SchemaText> = ::std::sync::OnceLock::new();
                TEXT.get_or_init(|| #krate::SchemaText::of(&<#ident as #krate::Message>::schema()))
            }
        }
    }
}

/// Evaluated by the compiler: every field begins where the one before it ends, and the last ends the struct.
fn layout_checks(message: &Message) -> TokenStream {
    let Message { ident, name, krate, .. } = message;
    let fields = message.fields.iter().map(|Field { ident: field, name: field_name, ty, .. }| {
        let gap = format!(
            "padding before `{field_name}` of `{name}`: put wider fields first, or fill the gap with a named field"
        );
        let nests = nests(krate, ty);
        let fits = quote_spanned! {at(field)=>
            ::core::assert!(nests, "a message with a tail cannot be part of another message");
            ::core::assert!(size > 0, "an empty array or message cannot be part of a message");
            ::core::assert!(::core::mem::offset_of!(#ident, #field) == end, #gap);
        };
        quote! {
            let (nests, size) = (#nests, ::core::mem::size_of::<#ty>());
            #fits
            let end = end + size;
        }
    });
    let gap = format!("padding behind the last field of `{name}`: fill the gap with a named field");
    let align = format!("`{name}` or its tail is aligned to more than 8 bytes, as no slot of a channel is");
    let whole = quote_spanned! {at(ident)=>
        ::core::assert!(::core::mem::size_of::<#ident>() == end, #gap);
        ::core::assert!(::core::mem::align_of::<#ident>() <= 8, #align);
    };
    let tail = message.tail.as_ref().map(|tail| {
        let nests = nests(krate, tail);
        let fits = quote_spanned! {at(ident)=>
            ::core::assert!(nests, "a message with a tail cannot be the tail of another message");
            ::core::assert!(size > 0, "an empty array or message cannot be a tail's element");
            ::core::assert!(align <= 8, #align);
        };
        quote! {
            let (nests, size, align) =
                (#nests, ::core::mem::size_of::<#tail>(), ::core::mem::align_of::<#tail>());
            #fits
        }
    });
    quote! {
        const _: () = {
            let end: usize = 0;
            #(#fields)*
            #whole
            #tail
        };
    }
}

/// Whether a type may be a field or tail; where it is not even plain data, the error points to the type.
fn nests(krate: &TokenStream, ty: &Type) -> TokenStream {
    quote_spanned!(at(ty)=> <#ty as #krate::Plain>::NESTS)
}

fn describe(message: &Message, field: &Field) -> TokenStream {
    let Message { ident: owner, krate, .. } = message;
    let Field { ident, name, ty, doc, unit, values } = field;
    let unit = match unit {
        Some(unit) => quote!(::core::option::Option::Some(#unit)),
        None => quote!(::core::option::Option::None),
    };
    quote_spanned! {at(ty)=>
        #krate::Field::of::<#ty>(#name, ::core::mem::offset_of!(#owner, #ident), #unit, &[#(#values),*], #doc)
    }
}

/// Errors are shown at this place, but names mean what they mean in this macro: the place may be in another macro.
fn at(place: &impl Spanned) -> Span {
    Span::call_site().located_at(place.span())
}
